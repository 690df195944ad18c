// Bullet and water: bodies of a 3D engine float and sink in a tank of libascc's. SPDX-License-Identifier: MIT
//
//     bullet MODEL SCENE FRAMES FOLDER [EVERY]      scenes: float, sink, boat
//
// As examples/hosts/box2d.cpp, in 3D: a box of half or twice the density of water, or a light flat one in a wave.
#include <btBulletDynamicsCommon.h>

#include <cstdlib>
#include <cstring>
#include <memory>

#include "camera.hpp"

// What Bullet needs to step, in the order of its making.
struct engine {
    btDefaultCollisionConfiguration configuration;
    btCollisionDispatcher dispatcher{&configuration};
    btDbvtBroadphase broadphase;
    btSequentialImpulseConstraintSolver solver;
    btDiscreteDynamicsWorld world{&dispatcher, &broadphase, &solver, &configuration};
    std::vector<std::unique_ptr<btCollisionShape>> shapes;
    std::vector<std::unique_ptr<btRigidBody>> bodies;

    btRigidBody *add(btCollisionShape *shape, double mass, const btVector3 &place)
    {
        btVector3 inertia(0, 0, 0);
        shapes.emplace_back(shape);
        if (mass > 0)
            shape->calculateLocalInertia(btScalar(mass), inertia);
        bodies.push_back(std::make_unique<btRigidBody>(btScalar(mass), nullptr, shape, inertia));
        bodies.back()->setWorldTransform(btTransform(btQuaternion::getIdentity(), place));
        bodies.back()->setActivationState(DISABLE_DEACTIVATION);
        world.addRigidBody(bodies.back().get());
        return bodies.back().get();
    }
    ~engine()
    {
        for (const auto &body : bodies)
            world.removeRigidBody(body.get());
    }
};

static ascc_shape box_of(const btVector3 &half)
{
    auto box = ascc::sized<ascc_shape>();
    box.kind = ASCC_SHAPE_BOX;
    for (int c = 0; c < 3; c++)
        box.half[c] = half[c];
    return box;
}

static ascc_pose pose_of(const btRigidBody *body)
{
    auto pose = ascc::sized<ascc_pose>();
    const btTransform &at = body->getWorldTransform();
    const btQuaternion turn = at.getRotation();
    for (int c = 0; c < 3; c++) {
        pose.position[c] = at.getOrigin()[c];
        pose.velocity[c] = body->getLinearVelocity()[c];
        pose.spin[c] = body->getAngularVelocity()[c];
    }
    for (int c = 0; c < 4; c++)
        pose.rotation[c] = turn[c];
    pose.jump = 0.2; // where Bullet stops a body that falls on the floor
    return pose;
}

// A tank that Bullet's bodies stay in, too: inner faces at x, z = +-half and y = 0.
static void add_tank(engine &bullet, ascc::particles &water, double half, double height)
{
    auto tank = box_of(btVector3(btScalar(half), btScalar(height / 2), btScalar(half)));
    tank.water = ASCC_WATER_INSIDE;
    tank.open = 8; // the face at +y
    auto pose = ascc::sized<ascc_pose>();
    pose.position[1] = height / 2;
    water.add_body(tank, pose);
    bullet.add(new btStaticPlaneShape(btVector3(0, 1, 0), 0), 0, btVector3(0, 0, 0));
    for (int c = 0; c < 4; c++) {
        btVector3 inwards(0, 0, 0);
        inwards[c / 2 * 2] = c % 2 ? -1 : 1;
        bullet.add(new btStaticPlaneShape(inwards, btScalar(-half)), 0, btVector3(0, 0, 0));
    }
}

static void run(const char *model_name, const char *scene, int frames, const char *folder,
                int every)
{
    const ascc::context context;
    const ascc::model model(context, model_name);
    ascc::particles water(context, model);
    ascc::step step(context, model);
    const double h = model.info().particle_spacing, dt = model.info().time_step;
    const bool boat = std::strcmp(scene, "boat") == 0;
    const int side = 16, rows = 8;
    engine bullet;
    bullet.world.setGravity(btVector3(0, btScalar(-9.81), 0));
    add_tank(bullet, water, (side + 1) * h / 2, 24 * h);
    const std::size_t tank = water.count(ASCC_BOUNDARY);
    const btVector3 half = btScalar(h) * (boat ? btVector3(4, 1.5, 2.5) : btVector3(2.5, 2.5, 2.5));
    const double density = std::strcmp(scene, "sink") == 0 ? 2000 : boat ? 300 : 500;
    btRigidBody *body =
        bullet.add(new btBoxShape(half), 8 * density * double(half[0] * half[1] * half[2]),
                   btVector3(0, btScalar(boat ? (rows + 2) * h : (rows + 4.5) * h), 0));
    const std::int32_t number = water.add_body(box_of(half), pose_of(body));
    std::vector<float> fluid;
    for (int j = 0; j < rows + (boat ? 4 : 0); j++) // the wave begins as a step at one side
        for (int k = 0; k < side; k++)
            for (int i = 0; i < (j < rows ? side : 4); i++)
                fluid.insert(fluid.end(), {float((i - (side - 1) / 2.0) * h), float((j + 1) * h),
                                           float((k - (side - 1) / 2.0) * h)});
    water.add_fluid(ascc::input(fluid));
    const double wide = (side + 1) * h / 2; // the tank's walls would hide what is in it
    camera pictures(folder, 3, {-wide, 0, -wide}, {wide, 18 * h, wide}, h, tank);
    for (int frame = 0; frame <= frames; frame++) {
        if (frame % every == 0)
            pictures.draw(water, frame, scene, frame * dt);
        water.move_body(number, pose_of(body));
        step.run(water, 1);
        const auto got = water.body_impulses({number})[0];
        const btScalar quantum = btScalar(water.momentum_quantum());
        body->applyCentralImpulse(quantum * btVector3(btScalar(got.impulse[0]),
                                                      btScalar(got.impulse[1]),
                                                      btScalar(got.impulse[2])));
        body->applyTorqueImpulse(
            btVector3(btScalar(got.torque[0]), btScalar(got.torque[1]), btScalar(got.torque[2])));
        bullet.world.stepSimulation(btScalar(dt), 20, btScalar(dt / 8));
    }
    std::printf("%s: height %.2f spacings, speed %.3f m/s, spin %.2f rad/s\n", scene,
                double(body->getWorldTransform().getOrigin()[1]) / h,
                double(body->getLinearVelocity().length()),
                double(body->getAngularVelocity().length()));
}

int main(int argc, char **argv)
{
    if (argc < 5) {
        std::fprintf(stderr, "usage: bullet MODEL float|sink|boat FRAMES FOLDER [EVERY]\n");
        return 2;
    }
    try {
        run(argv[1], argv[2], std::atoi(argv[3]), argv[4], argc > 5 ? std::atoi(argv[5]) : 50);
    } catch (const std::exception &error) {
        std::fprintf(stderr, "bullet: %s\n", error.what());
        return 1;
    }
}
