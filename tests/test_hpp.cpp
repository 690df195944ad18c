// What ascc/ascc.hpp promises: prints the facts that do not hold, one a line. Built and run by
// tests/install_test.sh. SPDX-License-Identifier: MIT
#include <algorithm>
#include <array>
#include <cstdio>
#include <cstring>
#include <memory>
#include <new>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <ascc/ascc.hpp>

static int failures;

static void fact(bool holds, const char *what)
{
    if (!holds)
        std::printf("does not hold: %s\n", what);
    failures += !holds;
}

// The status thrown, with the message in *text; OK where nothing is.
template <class Call> static ascc_status thrown(Call call, std::string *text = nullptr)
{
    try {
        call();
    } catch (const ascc::error &error) {
        if (text)
            *text = error.what();
        return error.status();
    }
    return ASCC_OK;
}

struct vertex {
    float position[3];
    std::uint32_t colour;
    std::array<double, 3> velocity;
    float mass;
};

// Exactly so many numbers, with nothing behind them.
static std::vector<float> exactly(std::size_t count, float step)
{
    std::vector<float> values;
    values.reserve(count);
    for (std::size_t i = 0; i < count; i++)
        values.push_back(step * static_cast<float>(i));
    values.shrink_to_fit();
    return values;
}

static void arrays(const ascc::context &context, const ascc::model &model)
{
    ascc::particles set(context, model);
    const std::size_t d = set.dimension();
    const auto packed = exactly(5 * d, 0.1f);
    fact(set.add_fluid(packed).size() == 5 && set.count() == 5, "packed numbers fill rows");
    fact(set.read(ASCC_FLUID, ASCC_POSITION) == packed, "and come back");

    std::vector<vertex> vertices(4);
    for (std::size_t i = 0; i < 4; i++) {
        const float x = static_cast<float>(i);
        vertices[i] = {{x, 10 + x, 20 + x}, 7, {1.0 * x, 2.0, 3.0}, 0.5f};
    }
    const auto &read_only = vertices;
    set.add_fluid(ascc::member(read_only, &vertex::position),
                  ascc::member(vertices, &vertex::velocity), ascc::member(vertices, &vertex::mass));
    std::vector<std::array<double, 3>> doubles(4); // wider than 2D wants: the rest is left alone
    set.get(ASCC_FLUID, ASCC_POSITION, doubles, 5);
    fact(doubles[3][0] == 3.0 && doubles[3][1] == 13.0 && doubles[3][2] == (d == 3 ? 23.0 : 0.0),
         "members of structs are read, arrays of arrays written");
    float masses[4] = {};
    set.get(ASCC_FLUID, ASCC_MASS, {masses, 4}, 5);
    fact(masses[3] == 0.5f, "a pointer and a number of masses");
    for (vertex &v : vertices)
        v.position[0] = -1.0f;
    set.get(ASCC_FLUID, ASCC_POSITION, ascc::member(vertices, &vertex::position), 5);
    fact(vertices[2].position[0] == 2.0f && vertices[2].colour == 7,
         "members of structs are written");

    auto columns = exactly(3 * 6, 1.0f); // x, y, z apart
    set.set(ASCC_FLUID, ASCC_POSITION,
            ascc::input::strided(columns.data(), 6, 3, sizeof(float), 6 * sizeof(float)));
    fact(set.read(ASCC_FLUID, ASCC_POSITION)[d + 1] == 7.0f, "separate arrays of x, y, z");

    fact(set.add_fluid(std::vector<float>()).empty() &&
             set.add_fluid(ascc::input(packed.data(), 0)).empty(),
         "no rows are no rows");
    fact(set.add_fluid(ascc::input(static_cast<const float *>(nullptr), 0)).empty(),
         "even nowhere");
}

static void short_arrays(const ascc::context &context, const ascc::model &model)
{
    ascc::particles set(context, model);
    const std::size_t d = set.dimension();
    const auto position = exactly(4 * d, 1.0f), three = exactly(3 * d, 1.0f),
               four = exactly(4, 1.0f);
    std::string text;
    fact(thrown([&] { set.add_fluid(position, three); }, &text) == ASCC_ERROR_ARGUMENT &&
             text.find("velocity: 3 rows for 4") != std::string::npos,
         "velocities too few are refused by name");
    fact(thrown([&] { set.add_fluid(position, {}, three); }) == ASCC_ERROR_ARGUMENT,
         "masses of another number are refused");
    fact(thrown([&] { set.add_boundary(position, three); }) == ASCC_ERROR_ARGUMENT,
         "so are normals");
    fact(thrown([&] { set.add_fluid(exactly(4 * d + 1, 1.0f)); }) == ASCC_ERROR_ARGUMENT,
         "numbers that are not whole rows are refused");
    fact(thrown([&] { set.add_fluid(std::vector<std::array<float, 1>>(4)); }) ==
             ASCC_ERROR_ARGUMENT,
         "rows too short are refused");
    fact(thrown([&] { (void)ascc::input::strided(four.data(), 4, d, 0); }) == ASCC_ERROR_ARGUMENT,
         "a stride of 0 is refused");
    fact(set.count() == 0, "nothing was added");
    set.add_fluid(position);
    std::vector<float> out(5 * d);
    fact(thrown([&] { set.get(ASCC_FLUID, ASCC_POSITION, out); }, &text) == ASCC_ERROR_ARGUMENT &&
             text.find("beyond") != std::string::npos,
         "more rows than there are: the context's message is told");
    ascc::step step(context, model);
    ascc::forces forces;
    forces.acceleration = three;
    fact(thrown([&] { step.run(set, forces); }) == ASCC_ERROR_ARGUMENT,
         "accelerations of another number are refused");
}

static void handles(const ascc::context &context, const char *path)
{
    static_assert(!std::is_copy_constructible<ascc::model>::value &&
                      !std::is_copy_constructible<ascc::particles>::value &&
                      !std::is_copy_constructible<ascc::step>::value,
                  "what owns a handle is not copied");
    static_assert(std::is_nothrow_move_constructible<ascc::step>::value, "but moved");
    std::string text;
    fact(thrown([&] { ascc::model(context, "/nonexistent"); }, &text) == ASCC_ERROR_FILE &&
             text.find("/nonexistent") != std::string::npos,
         "a model that is not there is told by name");
    fact(thrown([] { ascc::context(-1); }) == ASCC_ERROR_ARGUMENT, "a context of -1 threads");

    auto apart = std::make_unique<ascc::context>(2);
    ascc::model model(*apart, path);
    ascc::particles set(*apart, model);
    ascc::step step(*apart, model);
    apart.reset(); // what was made of it holds it
    const std::size_t d = set.dimension();
    set.add_fluid(exactly(6 * d, 0.01f));
    const ascc::model moved(std::move(model));
    step.run(set, 2);
    fact(step.statistics().steps == 2 && step.statistics().size == sizeof(ascc_step_statistics),
         "statistics tell the run");
    fact(thrown([&] { ascc::particles(context, model); }) ==
             ASCC_ERROR_ARGUMENT, // NOLINT: moved from
         "a handle that was moved away is an error, no crash");
    const auto bytes = moved.bytes();
    fact(ascc::model(context, bytes.first, bytes.second).info().parameter_count ==
             moved.info().parameter_count,
         "a model is loaded of another's bytes");

    const auto before = set.snapshot();
    const auto hash = set.hash();
    const auto ids = set.ids();
    set.remove({ids[1], ids[4]});
    fact(set.count() == 4 && !set.find(ids[1]) && set.find(ids[5])->second == 3,
         "rows are found by id");
    fact(thrown([&] { set.remove({ids[1]}); }) == ASCC_ERROR_ARGUMENT, "an id that is gone");
    set.restore(before);
    fact(set.count() == 6 && set.hash() == hash, "a snapshot brings them back");
    fact(thrown([&] {
             set.restore({1, 2, 3});
         }) == ASCC_ERROR_FORMAT,
         "what is no snapshot is told");
    const auto total = set.total_momentum();
    std::array<std::int64_t, 3> sum{};
    const auto quanta = set.momentum();
    for (std::size_t k = 0; k < quanta.size(); k++)
        sum[k % d] += quanta[k];
    fact(sum == total, "momenta add up to the total");
    fact(set.measure().mass > 0.0, "the set is measured");
    const auto wall = exactly(2 * d, 0.0f);
    auto normal = wall;
    normal[1] = normal[d + 1] = 1.0f;
    set.add_boundary(wall, normal, 9);
    fact(set.bodies() == std::vector<std::int32_t>{9, 9}, "bodies of walls");
    fact(set.body_impulse(9).impulse == std::array<std::int64_t, 3>{}, "no run, no impulse");
    auto ball = ascc::sized<ascc_shape>();
    ball.kind = ASCC_SHAPE_SPHERE;
    ball.radius = 3 * moved.info().particle_spacing;
    auto pose = ascc::sized<ascc_pose>();
    pose.position[1] = 50.0;
    pose.velocity[0] = 0.25;
    const std::int32_t body = set.add_body(ball, pose);
    step.run(set, 2);
    const double way = 2 * moved.info().time_step * 0.25;
    fact(std::abs(set.body(body).position[0] - way) < 1e-12, "a step carries a body along");
    fact(set.body_numbers() == std::vector<std::int32_t>{10} && body == 10, "bodies have numbers");
    fact(set.body_impulses({body})[0].impulse == std::array<std::int64_t, 3>{},
         "no water, no push");
    pose.position[0] = 1e3;
    fact(thrown([&] { set.move_body(body, pose); }) == ASCC_ERROR_RANGE, "a jump is told");
    set.remove_body(body);
    fact(set.body_numbers().empty(), "a body is gone");
    auto tap = ascc::sized<ascc_tap>();
    tap.position[1] = 60.0;
    const auto came = set.run_tap(tap, 1.0);
    auto drain = ascc::sized<ascc_drain>();
    drain.before = came.at(0) + 1;
    fact(came.size() == 1 && set.run_drain(drain).back() == came[0] && set.count() == 0,
         "what a tap lets in a drain takes out");
    set.clear(ASCC_BOUNDARY);
    set.resize_fluid(3);
    fact(set.count() == 3 && set.count(ASCC_BOUNDARY) == 0, "rows are dropped");
}

// An allocator that throws, wrapped as ascc_context_options says.
static std::size_t held, fails_after;
static void *allocate(void *, std::size_t size, std::size_t alignment)
{
    try {
        if (held >= fails_after)
            throw std::bad_alloc();
        void *memory = ::operator new(size, std::align_val_t(alignment));
        held++;
        return memory;
    } catch (const std::bad_alloc &) {
        return nullptr;
    }
}
static void release(void *, void *memory, std::size_t)
{
    held -= memory != nullptr;
    ::operator delete(memory, std::align_val_t(64));
}
static void *reallocate(void *user, void *memory, std::size_t old_size, std::size_t size,
                        std::size_t alignment)
{
    void *moved = allocate(user, size, alignment);
    if (moved && memory)
        std::memcpy(moved, memory, std::min(size, old_size));
    if (moved)
        release(user, memory, old_size);
    return moved;
}

static void out_of_memory(const char *path)
{
    auto options = ascc::sized<ascc_context_options>();
    options.allocate = allocate;
    options.reallocate = reallocate;
    options.release = release;
    int failed = 0;
    for (fails_after = 0; fails_after < 400; fails_after++) {
        const ascc_status status = thrown([&] {
            const ascc::context context(options);
            const ascc::model model(context, path);
            ascc::particles set(context, model);
            set.add_fluid(exactly(12 * set.dimension(), 0.02f));
            ascc::step(context, model).run(set);
        });
        fact(status == ASCC_OK || status == ASCC_ERROR_MEMORY, "no memory is MEMORY");
        fact(held == 0, "nothing is kept after a failure");
        failed += status != ASCC_OK;
        if (status == ASCC_OK)
            break;
    }
    fact(failed > 5 && fails_after < 400, "with enough of it, it runs");
}

static void ladders(const ascc::context &context, const ascc::model &model)
{
    ascc::particles set(context, model), other(context, model);
    set.add_fluid(exactly(12 * set.dimension(), 0.02f));
    other.restore(set.snapshot());
    ascc::ladder ladder(context, {&model, &model}, 1e-9), again(context, {&model, &model});
    ladder.run(set, 3);
    fact(ladder.statistics().late == 3 && ladder.choices().size() == 3, "a ladder tells its steps");
    again.replay(other, ladder.choices());
    fact(set.hash() == other.hash(), "choices run again give the same bits");
    again.restore(ladder.snapshot());
    fact(again.choices() == ladder.choices(), "a snapshot has the choices");
    again.measure(other);
    fact(set.hash() == other.hash(), "measuring changes nothing");
    fact(thrown([&] { again.set_budget(-1.0); }) == ASCC_ERROR_ARGUMENT,
         "a budget is no less than 0");
    fact(thrown([&] { ascc::ladder(context, {}); }) == ASCC_ERROR_ARGUMENT, "a ladder has a model");
}

int main(int, char **argv)
{
    const ascc::context context;
    for (char **path = argv + 1; *path; path++) {
        const ascc::model model(context, *path);
        arrays(context, model);
        short_arrays(context, model);
        handles(context, *path);
        out_of_memory(*path);
        ladders(context, model);
    }
    return failures != 0;
}
