// Box2D and water: bodies of a 2D engine float, sink and turn in a tank of libascc's. SPDX-License-Identifier: MIT
//
//     box2d MODEL SCENE FRAMES FOLDER [EVERY]      scenes: float, sink, wheel
//
// Both sides keep their own clockwork: before a step each body of the engine tells the water where it is and how it
// moves; after it the engine receives, exactly, what the water gave. Pictures are PNG files in FOLDER.
#include <box2d/box2d.h>

#include <cstdlib>
#include <cstring>

#include "camera.hpp"

struct solid {
    std::int32_t number;
    b2Body *body;
};

static ascc_shape box_of(double width, double height)
{
    auto box = ascc::sized<ascc_shape>();
    box.kind = ASCC_SHAPE_BOX;
    box.half[0] = width / 2;
    box.half[1] = height / 2;
    return box;
}

static ascc_pose pose_of(const b2Body *body)
{
    auto pose = ascc::sized<ascc_pose>();
    const b2Vec2 at = body->GetWorldCenter(), velocity = body->GetLinearVelocity();
    pose.position[0] = at.x;
    pose.position[1] = at.y;
    pose.angle = body->GetAngle();
    pose.velocity[0] = velocity.x;
    pose.velocity[1] = velocity.y;
    pose.spin[2] = body->GetAngularVelocity();
    return pose;
}

// A box in both worlds, of a density relative to water's.
static solid add_box(b2World &world, ascc::particles &water, double density, double x, double y,
                     double width, double height)
{
    b2BodyDef place;
    place.type = b2_dynamicBody;
    place.position.Set(float(x), float(y));
    b2PolygonShape shape;
    shape.SetAsBox(float(width / 2), float(height / 2));
    b2Body *body = world.CreateBody(&place);
    body->CreateFixture(&shape, float(1000 * density));
    return {water.add_body(box_of(width, height), pose_of(body)), body};
}

// A tank that Box2D's bodies stay in, too.
static void add_tank(b2World &world, ascc::particles &water, double width, double height)
{
    auto tank = box_of(width, height);
    tank.water = ASCC_WATER_INSIDE;
    tank.open = 8; // the face at +y
    auto pose = ascc::sized<ascc_pose>();
    pose.position[1] = height / 2;
    water.add_body(tank, pose);
    const float w = float(width / 2), h = float(height);
    const b2Vec2 corners[4] = {{w, h}, {w, 0}, {-w, 0}, {-w, h}}; // its right side holds
    b2ChainShape chain;
    chain.CreateChain(corners, 4, b2Vec2(w, 2 * h), b2Vec2(-w, 2 * h));
    b2BodyDef fixed;
    world.CreateBody(&fixed)->CreateFixture(&chain, 0.0f);
}

// One step of both. What the water gave in whole quanta becomes the engine's impulse.
static void advance(b2World &world, ascc::particles &water, ascc::step &step,
                    const std::vector<solid> &solids, double dt)
{
    for (const solid &s : solids)
        water.move_body(s.number, pose_of(s.body));
    step.run(water, 1);
    const double quantum = water.momentum_quantum();
    for (const solid &s : solids) {
        const auto got = water.body_impulses({s.number})[0];
        const b2Vec2 impulse(float(double(got.impulse[0]) * quantum),
                             float(double(got.impulse[1]) * quantum));
        s.body->ApplyLinearImpulseToCenter(impulse, true);
        s.body->ApplyAngularImpulse(float(got.torque[2]), true);
    }
    world.Step(float(dt), 8, 3);
}

static void run(const char *model_name, const char *scene, int frames, const char *folder,
                int every)
{
    const ascc::context context;
    const ascc::model model(context, model_name);
    ascc::particles water(context, model);
    ascc::step step(context, model);
    const double h = model.info().particle_spacing, dt = model.info().time_step;
    const bool wheel = std::strcmp(scene, "wheel") == 0;
    const double density = std::strcmp(scene, "sink") == 0 ? 2.0 : 0.5, size = wheel ? 2 : 8;
    const int columns = 32, rows = 16;
    b2World world(b2Vec2(0, -9.81f));
    std::vector<solid> solids;
    std::vector<float> fluid;
    add_tank(world, water, (columns + 1) * h, 40 * h);
    if (wheel) { // a bar on an axle in the surface, driven
        solids.push_back(add_box(world, water, 1, 0, 17 * h, 20 * h, size * h));
        b2BodyDef fixed;
        b2RevoluteJointDef axle;
        axle.Initialize(world.CreateBody(&fixed), solids[0].body, b2Vec2(0, float(17 * h)));
        axle.enableMotor = true;
        axle.motorSpeed = 2.0f;
        axle.maxMotorTorque = 1e6f;
        world.CreateJoint(&axle);
    } else {
        solids.push_back(add_box(world, water, density, 0, 26 * h, size * h, size * h));
    }
    for (int j = 0; j < rows; j++)
        for (int i = 0; i < columns; i++)
            fluid.insert(fluid.end(), {float((i - (columns - 1) / 2.0) * h), float((j + 1) * h)});
    if (wheel) // none where the bar begins
        fluid.resize(fluid.size() - 2 * 3 * columns);
    water.add_fluid(ascc::input(fluid));
    camera pictures(folder, 2, {-18 * h, -h, 0}, {18 * h, 32 * h, 0}, h);
    for (int frame = 0; frame <= frames; frame++) {
        if (frame % every == 0)
            pictures.draw(water, frame, scene, frame * dt);
        advance(world, water, step, solids, dt);
    }
    const b2Body *body = solids[0].body;
    std::printf("%s: height %.3f m (%.1f spacings), speed %.3f m/s, turns %.2f/s\n", scene,
                body->GetPosition().y, body->GetPosition().y / h,
                body->GetLinearVelocity().Length(), body->GetAngularVelocity());
}

int main(int argc, char **argv)
{
    if (argc < 5) {
        std::fprintf(stderr, "usage: box2d MODEL float|sink|wheel FRAMES FOLDER [EVERY]\n");
        return 2;
    }
    try {
        run(argv[1], argv[2], std::atoi(argv[3]), argv[4], argc > 5 ? std::atoi(argv[5]) : 100);
    } catch (const std::exception &error) {
        std::fprintf(stderr, "box2d: %s\n", error.what());
        return 1;
    }
}
