// The smallest host in C++11: handles that destroy themselves. SPDX-License-Identifier: MIT
#include <cstdio>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include <ascc/ascc.h>

template <class Handle, void (*destroy)(Handle **)> struct Destroy {
    void operator()(Handle *handle) const
    {
        destroy(&handle);
    }
};
template <class Handle, void (*destroy)(Handle **)>
using Owned = std::unique_ptr<Handle, Destroy<Handle, destroy>>;

using Context = Owned<ascc_context, ascc_context_destroy>;
using Model = Owned<ascc_model, ascc_model_destroy>;
using Particles = Owned<ascc_particles, ascc_particles_destroy>;
using Step = Owned<ascc_step, ascc_step_destroy>;

static void check(ascc_status status, const std::string &message)
{
    if (status != ASCC_OK)
        throw std::runtime_error(std::string(ascc_status_text(status)) + ": " + message);
}

static void run(const char *path)
{
    ascc_context *context_handle = nullptr;
    check(ascc_context_create(nullptr, &context_handle), "context");
    const Context context(context_handle);

    ascc_model *model_handle = nullptr;
    const ascc_status loaded = ascc_model_load(context.get(), path, &model_handle);
    char message[256] = "";
    ascc_context_message(context.get(), message, sizeof message);
    check(loaded, message);
    const Model model(model_handle);

    ascc_model_info info = {};
    info.size = sizeof info;
    check(ascc_model_get_info(model.get(), &info), "info");

    ascc_particles_options options = {};
    options.size = sizeof options;
    check(ascc_model_particles_options(model.get(), 1.0, &options), "options");
    ascc_particles *particles_handle = nullptr;
    check(ascc_particles_create(context.get(), &options, &particles_handle), "particles");
    const Particles particles(particles_handle);

    const std::size_t side = 8, dimension = static_cast<std::size_t>(info.dimension);
    std::vector<float> position;
    for (std::size_t i = 0; i < side * side; i++) {
        position.push_back(static_cast<float>(info.particle_spacing * double(i % side)));
        position.push_back(static_cast<float>(info.particle_spacing * double(i / side)));
        position.resize(position.size() + dimension - 2); // flat, at z = 0
    }
    ascc_const_array positions = {};
    positions.data = position.data();
    check(ascc_particles_add_fluid(particles.get(), side * side, &positions, nullptr, nullptr,
                                   nullptr),
          ascc_particles_message(particles.get()));

    ascc_step *step_handle = nullptr;
    check(ascc_step_create(context.get(), model.get(), nullptr, &step_handle), "step");
    const Step step(step_handle);
    check(ascc_step_run(step.get(), particles.get(), nullptr, 100), ascc_step_message(step.get()));

    std::int64_t momentum[3];
    check(ascc_particles_total_momentum(particles.get(), momentum), "momentum");
    std::printf("%zu particles, 100 steps: momentum %lld %lld %lld quanta\n", side * side,
                static_cast<long long>(momentum[0]), static_cast<long long>(momentum[1]),
                static_cast<long long>(momentum[2]));
}

int main(int argc, char **argv)
{
    if (argc != 2) {
        std::fprintf(stderr, "usage: hello_cpp MODEL\n");
        return 2;
    }
    try {
        run(argv[1]);
    } catch (const std::exception &error) {
        std::fprintf(stderr, "%s: %s\n", argv[1], error.what());
        return 1;
    }
    return 0;
}
