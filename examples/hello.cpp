// The smallest host in C++17: handles that destroy themselves, errors as exceptions. SPDX-License-Identifier: MIT
#include <cstdio>
#include <exception>
#include <vector>

#include <ascc/ascc.hpp>

// As an engine keeps them.
struct vertex {
    float position[3]; // in 2D the third is left out
    float velocity[3];
};

static void run(const char *path)
{
    const ascc::context context(2); // threads
    const ascc::model model(context, path);
    const ascc_model_info info = model.info();

    const std::size_t side = 8;
    std::vector<vertex> vertices(side * side);
    for (std::size_t i = 0; i < vertices.size(); i++) {
        vertices[i].position[0] = static_cast<float>(info.particle_spacing * double(i % side));
        vertices[i].position[1] = static_cast<float>(info.particle_spacing * double(i / side));
        vertices[i].velocity[0] = 1.0f; // m/s
    }
    ascc::particles particles(context, model);
    particles.add_fluid(ascc::member(vertices, &vertex::position),
                        ascc::member(vertices, &vertex::velocity));

    // Without gravity and walls the momentum stays what it is, to the last quantum.
    ascc::forces none;
    none.gravity = {0.0, 0.0, 0.0};
    const auto before = particles.total_momentum();
    ascc::step step(context, model);
    step.run(particles, none, 100);
    const auto after = particles.total_momentum();
    particles.get(ASCC_FLUID, ASCC_POSITION, ascc::member(vertices, &vertex::position));

    std::printf("%zu particles, 100 steps; momentum in quanta:\n", vertices.size());
    std::printf("before %lld %lld %lld\n", static_cast<long long>(before[0]),
                static_cast<long long>(before[1]), static_cast<long long>(before[2]));
    std::printf("after  %lld %lld %lld\n", static_cast<long long>(after[0]),
                static_cast<long long>(after[1]), static_cast<long long>(after[2]));
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
        std::fprintf(stderr, "%s\n", error.what());
        return 1;
    }
    return 0;
}
