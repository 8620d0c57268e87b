// Every contact feature of Bullet's: a scene that shows it, beside stock Bullet in small substeps, beside a closed formula, and
// the impulses that the points then hold beside the change of momentum.
#include "conformance.h"
#include "scenes.h"

#include <algorithm>
#include <cmath>
#include <functional>

namespace {

using conformance::Reference;

// What a contact callback does to new points and to those that go on, in this scene.
std::function<void(btManifoldPoint&, const btCollisionObject*)> g_edit; // the second: the point's body 0
bool onAdded(btManifoldPoint& point, const btCollisionObjectWrapper* object0, int, int, const btCollisionObjectWrapper*, int, int) {
    g_edit(point, object0->getCollisionObject());
    return true;
}
void listen(btRigidBody& body) { body.setCollisionFlags(body.getCollisionFlags() | btCollisionObject::CF_CUSTOM_MATERIAL_CALLBACK); }

btVector3 velocity(const btRigidBody& body) { return body.getLinearVelocity(); }
btVector3 spin(const btRigidBody& body) { return body.getAngularVelocity(); }
btVector3 turn(const btRigidBody& body) { return btVector3(spin(body).x(), 0, 0); } // of a log along x
btVector3 place(const btRigidBody& body) { return body.getWorldTransform().getOrigin(); }
btVector3 height(const btRigidBody& body) { return btVector3(0, place(body).y(), 0); } // of a ball, which may roll off

struct Scene {
    std::function<btRigidBody&(TestWorld&)> make; // the body that is measured
    int frames = 60;
    btVector3 (*measure)(const btRigidBody&) = velocity;
    double gravity = kGravity;
    std::function<void(TestWorld&, btRigidBody&, int)> before; // each frame, by its number
};

// A row of the table. Stock is not asked for its impulses: those of its last substep alone are there to read.
class Row {
  public:
    Row(const char* name, Scene scene) : m_name(name), m_scene(std::move(scene)) { m_cairn = end(Behind::cairn, 1, &m_imbalance); }

    Row& stock(double tolerance, int parts = kSmall) {
        conformance::report(cell("beside stock"), away(end(Behind::stock, parts)), tolerance, unit(),
                            parts == 1 ? Reference::stockStep : Reference::stock);
        return *this;
    }
    Row& formula(const btVector3& expected, double tolerance) {
        conformance::report(cell("by formula"), away(expected), tolerance, unit(), Reference::formula);
        return *this;
    }
    // Stock must be elsewhere in the same steps, or the difference is none.
    Row& meant(const btVector3& expected, double tolerance, const char* why) {
        conformance::report(cell("meant to differ"), away(expected), tolerance, unit(), Reference::deliberate, why);
        EXPECT_GT(real((end(Behind::stock, 1) - expected).length()), 2 * tolerance) << m_name << ": stock does the same";
        return *this;
    }
    Row& absent(const char* column, const char* why) {
        conformance::absent(cell(column), why);
        return *this;
    }
    // In each step the impulses written back, along the points' directions, and gravity change the momentum.
    void impulses(double tolerance = 0.01) {
        conformance::report(cell("impulses written back"), m_imbalance, tolerance, "N", Reference::formula);
    }

  private:
    conformance::Cell cell(const char* column) const { return {"Contacts", m_name, column}; }
    const char* unit() const {
        return m_scene.measure == place || m_scene.measure == height ? "m"
               : m_scene.measure == spin || m_scene.measure == turn  ? "rad/s"
                                                                     : "m/s";
    }
    double away(const btVector3& from) const { return real((m_cairn - from).length()); }

    btVector3 end(Behind behind, int parts, double* imbalance = nullptr) const {
        const btVector3 gravity = vec(0, -m_scene.gravity, 0);
        TestWorld w(behind, gravity);
        g_edit = nullptr;
        btRigidBody& body = m_scene.make(w);
        for (int i = 0; i < m_scene.frames; ++i) {
            if (m_scene.before)
                m_scene.before(w, body, i);
            const btVector3 before = velocity(body);
            advance(w, parts);
            if (!imbalance)
                continue;
            EXPECT_EQ(w.cairn->lastStatus(), CAIRN_OK) << w.cairn->lastError();
            btVector3 given(0, 0, 0);
            eachPoint(w, [&](btPersistentManifold& manifold, btManifoldPoint& point) {
                const btScalar sign = manifold.getBody0() == &body ? btScalar(1) : btScalar(-1);
                given += sign * (point.m_normalWorldOnB.normalized() * point.m_appliedImpulse +
                                 point.m_lateralFrictionDir1 * point.m_appliedImpulseLateral1 +
                                 point.m_lateralFrictionDir2 * point.m_appliedImpulseLateral2);
            });
            const btVector3 rest = (velocity(body) - before - gravity * kDt) / body.getInvMass() - given;
            *imbalance = std::max(*imbalance, real(rest.length() / kDt));
        }
        return m_scene.measure(body);
    }

    const char* m_name;
    Scene m_scene;
    btVector3 m_cairn;
    double m_imbalance = 0;
};

class Contacts : public testing::Test {
  protected:
    void SetUp() override { gContactAddedCallback = onAdded; }
    void TearDown() override {
        gContactAddedCallback = nullptr;
        g_edit = nullptr;
    }
};

btRigidBody& ball(TestWorld& w, double mass, double above = 0) {
    return w.add(std::make_unique<btSphereShape>(btScalar(0.5)), static_cast<btScalar>(mass), at(0, static_cast<btScalar>(0.5 + above), 0));
}
// On the floor; 0.5 x 0.5 of friction. On feet: of a box that slides Bullet drops points, more in some steps than in others, and it rocks.
btRigidBody& sledge(TestWorld& w, const btVector3& going) {
    static btSphereShape foot(btScalar(0.1));
    auto shape = std::make_unique<btCompoundShape>();
    for (const btVector3& place : {vec(0.4, -0.15, 0), vec(-0.2, -0.15, 0.35), vec(-0.2, -0.15, -0.35)})
        shape->addChildShape(btTransform(btQuaternion::getIdentity(), place), &foot);
    btRigidBody& body = w.add(std::move(shape), 2, at(0, btScalar(0.25), 0));
    body.setLinearVelocity(going);
    return body;
}
btVector3 heading(double angle) { return vec(std::cos(angle), 0, std::sin(angle)); }

// ---- Restitution -----------------------------------------------------------------------------------------------------

Scene bounce(double e, double speed, double threshold) {
    Scene scene;
    scene.gravity = 0;
    scene.make = [=](TestWorld& w) -> btRigidBody& {
        w.world->getSolverInfo().m_restitutionVelocityThreshold = static_cast<btScalar>(threshold);
        w.floor().setRestitution(1);
        btRigidBody& body = ball(w, 2, 0.955); // at 4 m/s found 45 mm deep at first: nearer or shallower, stock adds to its bounce
        body.setRestitution(static_cast<btScalar>(e));
        body.setLinearVelocity(vec(0, -speed, 0));
        return body;
    };
    scene.frames = static_cast<int>(1.5 / speed / real(kDt));
    return scene;
}

TEST_F(Contacts, Restitution) {
    Row("restitution", bounce(0.5, 4, 0.2)).stock(0.02, 1).formula(vec(0, 2, 0), 0.02).impulses();
    Row("restitution 1", bounce(1, 4, 0.2)).stock(0.02, 1).formula(vec(0, 4, 0), 0.02).impulses();
    Row("restitution, under the threshold", bounce(1, 0.9, 1)).stock(0.02).formula(vec(0, 0, 0), 0.02).impulses();
}

// ---- Friction --------------------------------------------------------------------------------------------------------

Scene slide(int modes, double angle) {
    Scene scene;
    scene.frames = 30;
    scene.make = [=](TestWorld& w) -> btRigidBody& {
        w.world->getSolverInfo().m_solverMode |= modes;
        w.floor();
        return sledge(w, heading(angle) * 3);
    };
    return scene;
}

TEST_F(Contacts, FrictionInEverySolverMode) {
    const double slower = 3 - 0.25 * kGravity * 0.5;
    const int two = SOLVER_USE_2_FRICTION_DIRECTIONS, cached = SOLVER_ENABLE_FRICTION_DIRECTION_CACHING,
              fixed = SOLVER_DISABLE_VELOCITY_DEPENDENT_FRICTION_DIRECTION,
              interleaved = SOLVER_INTERLEAVE_CONTACT_AND_FRICTION_CONSTRAINTS;
    const btVector3 expected = heading(0.6) * static_cast<btScalar>(slower);
    const struct {
        const char* name;
        int modes;
    } rows[] = {{"friction, one direction", 0},
                {"friction, two directions", two},
                {"friction, interleaved", interleaved},
                {"friction, interleaved, two directions", interleaved | two}};
    for (const auto& row : rows)
        Row(row.name, slide(row.modes, 0.6)).stock(0.02).formula(expected, 0.02).impulses();
    const char* const cone = "one cone, whatever the mode: stock's is a single direction or a pyramid of fixed ones";
    Row("friction, directions cached", slide(cached, 0.6)).stock(0.02).formula(expected, 0.02).impulses();
    const char* const aslant = "stock's directions do not follow the slip";
    Row("friction, one fixed direction", slide(fixed, 0.6))
        .absent("beside stock", aslant)
        .formula(expected, 0.02)
        .meant(expected, 0.02, cone)
        .impulses();
    Row("friction, two fixed directions", slide(fixed | two, 0.6))
        .absent("beside stock", aslant)
        .formula(expected, 0.02)
        .meant(expected, 0.02, cone)
        .impulses();
    for (int bits = 0; bits < 16; ++bits) {
        const int modes = (bits & 1 ? two : 0) | (bits & 2 ? cached : 0) | (bits & 4 ? fixed : 0) | (bits & 8 ? interleaved : 0);
        for (const double angle : {0.0, 0.6}) {
            TestWorld w;
            const Scene scene = slide(modes, angle);
            btRigidBody& body = scene.make(w);
            w.step(scene.frames);
            EXPECT_LT((velocity(body) - heading(angle) * static_cast<btScalar>(slower)).length(), btScalar(0.02)) << modes << ", " << angle;
        }
    }
}

// A belt: the user's directions and m_contactMotion.
Scene belt(bool two, int frames) {
    Scene scene;
    scene.frames = frames;
    scene.make = [two](TestWorld& w) -> btRigidBody& {
        w.world->getSolverInfo().m_solverMode |= SOLVER_ENABLE_FRICTION_DIRECTION_CACHING | (two ? SOLVER_USE_2_FRICTION_DIRECTIONS : 0);
        btRigidBody& ground = w.floor();
        listen(ground);
        ground.setFriction(1);
        btRigidBody& rider = sledge(w, btVector3(0, 0, 0));
        g_edit = [&rider](btManifoldPoint& point, const btCollisionObject* body0) {
            const btScalar sign = body0 == &rider ? btScalar(1) : btScalar(-1); // of body 0 relative to body 1
            point.m_contactPointFlags |= BT_CONTACT_FLAG_LATERAL_FRICTION_INITIALIZED;
            point.m_lateralFrictionDir1 = btVector3(1, 0, 0);
            point.m_lateralFrictionDir2 = btVector3(0, 0, 1);
            point.m_contactMotion1 = sign * 2;
            point.m_contactMotion2 = sign * 1;
        };
        return rider;
    };
    return scene;
}

// One user's direction is all the friction there is, as strong as the direction is long; lateral impulses are in its units.
TEST_F(Contacts, UsersDirections) {
    const auto given = [](bool two) {
        Scene scene;
        scene.frames = 30;
        scene.make = [two](TestWorld& w) -> btRigidBody& {
            w.world->getSolverInfo().m_solverMode |=
                SOLVER_ENABLE_FRICTION_DIRECTION_CACHING | (two ? SOLVER_USE_2_FRICTION_DIRECTIONS : 0);
            listen(w.floor());
            g_edit = [](btManifoldPoint& point, const btCollisionObject*) {
                point.m_contactPointFlags |= BT_CONTACT_FLAG_LATERAL_FRICTION_INITIALIZED;
                point.m_lateralFrictionDir1 = btVector3(btScalar(0.5), 0, 0);
                point.m_lateralFrictionDir2 = btVector3(0, 0, 1);
            };
            return sledge(w, btVector3(3, 0, two ? 0 : 1));
        };
        return scene;
    };
    const double slower = 3 - 0.5 * 0.25 * kGravity * 0.5;
    Row("user's direction, half as long", given(false)).stock(0.03).formula(vec(slower, 0, 1), 0.02).impulses();
    Row("user's two directions", given(true)).stock(0.03).formula(vec(slower, 0, 0), 0.02).impulses();
    Row("conveyor, one direction", belt(false, 60)).stock(0.02).formula(vec(2, 0, 0), 0.02).impulses();
    // on its way the cone pulls straight towards the belt, mu g in all; stock's pyramid mu g along each direction
    const double pulled = 0.5 * kGravity * 0.1;
    Row("conveyor, two directions", belt(true, 60)).stock(0.02).formula(vec(2, 0, 1), 0.02).impulses();
    Row("conveyor, two directions, on the way", belt(true, 6))
        .absent("beside stock", "stock's pyramid pulls more strongly aslant")
        .formula(vec(2, 0, 1).normalized() * static_cast<btScalar>(pulled), 0.03)
        .meant(vec(2, 0, 1).normalized() * static_cast<btScalar>(pulled), 0.03, "a cone: mu N in all, not along each direction")
        .impulses();
}

// Pushed off its place by 4 mm, a box with friction anchors is drawn back; without, it stays there.
TEST_F(Contacts, FrictionAnchor) {
    for (const bool anchored : {true, false}) {
        Scene scene;
        scene.frames = 90;
        scene.measure = place;
        scene.make = [anchored](TestWorld& w) -> btRigidBody& {
            w.floor().setFriction(1);
            btRigidBody& box = w.box(2, btVector3(0, btScalar(0.5), 0));
            box.setFriction(1);
            if (anchored)
                box.setCollisionFlags(box.getCollisionFlags() | btCollisionObject::CF_HAS_FRICTION_ANCHOR);
            return box;
        };
        scene.before = [](TestWorld&, btRigidBody& box, int frame) {
            if (frame != 30)
                return;
            btTransform pose = box.getWorldTransform();
            pose.getOrigin() += btVector3(btScalar(0.004), 0, 0);
            box.setWorldTransform(pose);
        };
        Row(anchored ? "friction anchor" : "no friction anchor", scene)
            .stock(5e-4, 1)
            .formula(vec(anchored ? 0 : 0.004, 0.5, 0), 1e-3)
            .impulses();
    }
}

// Each axis of the body has its own friction; a body that is turned takes them along. Between the axes the ellipse takes most power
// from the slip: the force is S^2 v / |S v|, stock's S v.
TEST_F(Contacts, Anisotropic) {
    const auto sliding = [](double turn, double angle, int frames) {
        Scene scene;
        scene.frames = frames;
        scene.make = [=](TestWorld& w) -> btRigidBody& {
            w.floor();
            btRigidBody& body = sledge(w, heading(angle - turn) * 3);
            body.setWorldTransform(btTransform(btQuaternion(btVector3(0, 1, 0), static_cast<btScalar>(turn)), place(body)));
            body.setAnisotropicFriction(btVector3(btScalar(0.2), 1, btScalar(0.8)));
            return body;
        };
        return scene;
    };
    const double right = std::acos(0.0), mu = 0.25 * kGravity * 0.5;
    Row("anisotropic, along x", sliding(0.9, 0, 30))
        .stock(0.04)
        .formula(heading(-0.9) * static_cast<btScalar>(3 - 0.2 * mu), 0.02)
        .impulses();
    Row("anisotropic, along z", sliding(0.9, right, 30))
        .stock(0.04)
        .formula(heading(right - 0.9) * static_cast<btScalar>(3 - 0.8 * mu), 0.02)
        .impulses();
    const double x = std::cos(0.7), z = std::sin(0.7), size = 0.25 * kGravity * real(kDt) * 3 / std::hypot(0.2 * x, 0.8 * z);
    const btVector3 expected = vec(3 * x - 0.04 * x * size, 0, 3 * z - 0.64 * z * size); // in so short a time the slip hardly turns
    Row("anisotropic, between", sliding(0, 0.7, 3))
        .absent("beside stock", "stock's force is S v")
        .formula(expected, 0.01)
        .meant(expected, 0.01, "the force that takes most power")
        .impulses();
}

// ---- Rolling and spinning --------------------------------------------------------------------------------------------

Scene roll(double mass) {
    Scene scene;
    scene.make = [mass](TestWorld& w) -> btRigidBody& {
        w.floor().setRollingFriction(btScalar(0.05));
        btRigidBody& body = ball(w, mass);
        body.setRollingFriction(btScalar(0.05));
        body.setLinearVelocity(btVector3(3, 0, 0));
        body.setAngularVelocity(btVector3(0, 0, -6));
        return body;
    };
    return scene;
}

TEST_F(Contacts, RollingAndSpinning) {
    const btVector3 slowed = vec(3 - 5.0 / 7 * 0.05 * kGravity / 0.5, 0, 0); // the objects' 0.05 x 0.5 each, summed
    Row("rolling", roll(1)).stock(0.02).formula(slowed, 0.02).impulses();
    Row("rolling under a load", roll(100))
        .absent("beside stock", "stock caps the torque, whatever the load")
        .formula(slowed, 0.02)
        .meant(slowed, 0.02, "the bound goes with the load alone, where stock allows the coefficient times 1 N s a step")
        .impulses(1);

    Scene spins;
    spins.measure = spin;
    spins.make = [](TestWorld& w) -> btRigidBody& {
        btRigidBody& ground = w.floor();
        btRigidBody& body = ball(w, 1);
        for (btRigidBody* each : {&ground, &body}) {
            each->setRollingFriction(btScalar(0.05)); // stock has neither without
            each->setSpinningFriction(btScalar(0.02));
        }
        body.setAngularVelocity(btVector3(0, 8, 0));
        return body;
    };
    Row("spinning", spins).stock(0.02).formula(vec(0, 8 - 0.02 * kGravity / (0.4 * 0.25), 0), 0.02).impulses();

    // Bullet's capsules and cylinders resist rolling about their own axis only.
    for (const bool resists : {true, false}) {
        Scene logRolls;
        logRolls.measure = turn;
        logRolls.make = [resists](TestWorld& w) -> btRigidBody& {
            w.floor().setRollingFriction(btScalar(0.05));
            btRigidBody& log = w.add(std::make_unique<btCapsuleShapeX>(btScalar(0.5), btScalar(2)), 1, at(0, btScalar(0.5), 0));
            log.setRollingFriction(btScalar(0.05));
            log.setAnisotropicFriction(resists ? log.getCollisionShape()->getAnisotropicRollingFrictionDirection() : btVector3(0, 1, 1),
                                       btCollisionObject::CF_ANISOTROPIC_ROLLING_FRICTION);
            log.setLinearVelocity(btVector3(0, 0, 3));
            log.setAngularVelocity(btVector3(6, 0, 0));
            return log;
        };
        TestWorld w; // for its inertia: w' = -mu m g R / (I + m R^2) / R, the torque being mu m g
        const btRigidBody& log = logRolls.make(w);
        const double inertia = 1 / real(log.getInvInertiaDiagLocal().x()), slower = resists ? 0.05 * kGravity / (inertia + 0.25) : 0;
        Row(resists ? "anisotropic rolling, about the resisting axis" : "anisotropic rolling, about the free axis", logRolls)
            .stock(0.02)
            .formula(vec(6 - slower, 0, 0), 0.02)
            .impulses();
    }
}

// ---- Soft contacts ---------------------------------------------------------------------------------------------------

// A ball on a floor of stiffness k and damping d. Deeper than its split impulse's threshold, stock would leave a spring's push out
// of the velocities, and the body fall through.
Scene springy(double mass, double k, double d, bool split) {
    Scene scene;
    scene.measure = height;
    scene.make = [=](TestWorld& w) -> btRigidBody& {
        w.world->getSolverInfo().m_splitImpulse = split;
        w.floor();
        btRigidBody& soft = ball(w, mass);
        soft.setContactStiffnessAndDamping(static_cast<btScalar>(k), static_cast<btScalar>(d));
        return soft;
    };
    return scene;
}

TEST_F(Contacts, StiffnessAndDamping) {
    const double mass = 2, k = 800, d = 5, rest = mass * kGravity / k;
    Scene scene = springy(mass, k, d, false);
    scene.frames = 600;
    Row("stiffness and damping, at rest", scene).stock(0.03 * rest).formula(vec(0, 0.5 - rest, 0), 0.01 * rest).impulses();

    scene.frames = 9; // about its lowest point
    const double beta = d / (2 * mass), w = std::sqrt(k / mass - beta * beta), t = scene.frames * real(kDt);
    const double depth = rest * (1 - std::exp(-beta * t) * (std::cos(w * t) + beta / w * std::sin(w * t)));
    Row("stiffness and damping, on the way", scene).stock(0.1 * rest).formula(vec(0, 0.5 - depth, 0), 0.1 * rest).impulses();

    Scene deep = springy(mass, 300, 30, true);
    deep.frames = 300;
    const btVector3 held = vec(0, 0.5 - mass * kGravity / 300, 0);
    Row("stiffness, beyond the split impulse's threshold", deep)
        .absent("beside stock", "stock lets it sink")
        .formula(held, 1e-3)
        .meant(held, 1e-3, "a spring pushes at any depth")
        .impulses();

    // A spring and damper that cannot pull: e = exp(-b/w (pi - atan(2 b w / (w^2 - b^2)))).
    Scene bounces = bounce(1, 1, 0.2);
    const auto hard = bounces.make;
    bounces.make = [hard](TestWorld& world) -> btRigidBody& {
        world.world->getSolverInfo().m_splitImpulse = 0;
        btRigidBody& body = hard(world);
        body.setContactStiffnessAndDamping(800, 20);
        return body;
    };
    const double b = 20 / (2 * mass), ringing = std::sqrt(800 / mass - b * b);
    const double e = std::exp(-b / ringing * (std::acos(-1.0) - std::atan(2 * b * ringing / (ringing * ringing - b * b))));
    Row("stiffness and restitution", bounces)
        .absent("beside stock", "stock adds its restitution to the spring")
        .formula(vec(0, e, 0), 0.05)
        .meant(vec(0, e, 0), 0.05, "its spring bounces, not its restitution")
        .impulses();
}

// cfm and erp of a point are a spring k = erp / (dt cfm): the same depth at rest as stock's with that step.
TEST_F(Contacts, CfmAndErp) {
    const double mass = 2, cfm = 0.05, erp = 0.4, rest = mass * kGravity / (erp / (real(kDt) * cfm));
    Scene scene;
    scene.frames = 300;
    scene.measure = height;
    scene.make = [=](TestWorld& w) -> btRigidBody& {
        w.world->getSolverInfo().m_splitImpulse = 0;
        listen(w.floor());
        g_edit = [=](btManifoldPoint& point, const btCollisionObject*) {
            point.m_contactPointFlags |= BT_CONTACT_FLAG_HAS_CONTACT_CFM | BT_CONTACT_FLAG_HAS_CONTACT_ERP;
            point.m_contactCFM = static_cast<btScalar>(cfm);
            point.m_contactERP = static_cast<btScalar>(erp);
        };
        return ball(w, mass);
    };
    Row("CFM and ERP of a point", scene).stock(0.02 * rest, 1).formula(vec(0, 0.5 - rest, 0), 0.02 * rest).impulses();
}

// ---- Distance --------------------------------------------------------------------------------------------------------

// A point that is still apart lets the body come as near as it is, no nearer and no slower.
TEST_F(Contacts, Speculative) {
    const auto falling = [](double speed, bool threshold, int frames) {
        Scene scene;
        scene.gravity = 0;
        scene.frames = frames;
        scene.measure = place;
        scene.make = [=](TestWorld& w) -> btRigidBody& {
            btRigidBody& ground = w.floor();
            btRigidBody& body = ball(w, 1, 0.015);
            if (threshold)
                for (btRigidBody* each : {&ground, &body})
                    each->setContactProcessingThreshold(0);
            body.setLinearVelocity(vec(0, -speed, 0));
            return body;
        };
        return scene;
    };
    Row("speculative, on its way", falling(0.6, false, 1)).stock(1e-4).formula(vec(0, 0.505, 0), 1e-4).impulses();
    Row("speculative, at the surface", falling(0.6, false, 2)).stock(1e-3).formula(vec(0, 0.5, 0), 1e-3).impulses();
    // 20 mm a step from 15 mm: the point does not count until the next step
    Row("processing threshold 0", falling(1.2, true, 1)).stock(1e-4, 1).formula(vec(0, 0.495, 0), 1e-4).impulses();
}

// ---- Shapes and callbacks --------------------------------------------------------------------------------------------

btStridingMeshInterface* plain() {
    static btTriangleMesh* const mesh = [] {
        static btTriangleMesh triangles;
        for (int i = -4; i < 4; ++i)
            for (int k = -4; k < 4; ++k) {
                const btVector3 corner = vec(i, 0, k);
                triangles.addTriangle(corner, corner + vec(0, 0, 1), corner + vec(1, 0, 0));
                triangles.addTriangle(corner + vec(1, 0, 1), corner + vec(1, 0, 0), corner + vec(0, 0, 1));
            }
        return &triangles;
    }();
    return mesh;
}

// Each child of a compound has its manifold, each triangle of a mesh its normal.
TEST_F(Contacts, CompoundsAndMeshes) {
    const auto resting = [](bool compound, bool mesh) {
        Scene scene;
        scene.frames = 120;
        scene.measure = place;
        scene.make = [=](TestWorld& w) -> btRigidBody& {
            if (mesh)
                w.add(std::make_unique<btBvhTriangleMeshShape>(plain(), true), 0, at(0, 0, 0)).getCollisionShape()->setMargin(0);
            else
                w.floor();
            const btVector3 half(btScalar(0.3), btScalar(0.3), btScalar(0.3));
            const btTransform pose = at(btScalar(0.2), btScalar(0.32), btScalar(0.1));
            if (!compound)
                return w.add(std::make_unique<btBoxShape>(half), 3, pose);
            static btBoxShape part(half);
            auto dumbbell = std::make_unique<btCompoundShape>();
            dumbbell->addChildShape(at(-1, 0, 0), &part);
            dumbbell->addChildShape(at(1, 0, 0), &part);
            return w.add(std::move(dumbbell), 3, pose);
        };
        return scene;
    };
    const btVector3 expected = vec(0.2, 0.3, 0.1);
    Row("compound on a box", resting(true, false)).stock(2e-3).formula(expected, 2e-3).impulses();
    Row("box on a mesh", resting(false, true)).stock(2e-3).formula(expected, 2e-3).impulses();
    Row("compound on a mesh", resting(true, true)).stock(2e-3).formula(expected, 2e-3).impulses();
}

// What a callback writes to a point is what is solved.
TEST_F(Contacts, Callbacks) {
    Scene scene;
    scene.make = [](TestWorld& w) -> btRigidBody& {
        listen(w.floor());
        g_edit = [](btManifoldPoint& point, const btCollisionObject*) {
            point.m_combinedFriction = 0;
            point.m_normalWorldOnB *= btScalar(1.01); // interpolated normals are not quite unit
        };
        return sledge(w, btVector3(2, 0, 0));
    };
    Row("callback sets friction to 0", scene).stock(1e-3).formula(vec(2, 0, 0), 1e-3).impulses();
    scene.make = [](TestWorld& w) -> btRigidBody& {
        listen(w.floor());
        g_edit = [](btManifoldPoint& point, const btCollisionObject*) { point.m_combinedFriction = btScalar(0.1); };
        return sledge(w, btVector3(2, 0, 0));
    };
    scene.frames = 30;
    Row("callback sets friction to 0.1", scene).stock(0.02).formula(vec(2 - 0.1 * kGravity * 0.5, 0, 0), 0.02).impulses();
    scene.make = [](TestWorld& w) -> btRigidBody& {
        btRigidBody& ground = w.floor();
        ground.setCollisionFlags(ground.getCollisionFlags() | btCollisionObject::CF_NO_CONTACT_RESPONSE);
        return sledge(w, btVector3(2, 0, 0));
    };
    Row("object without response", scene)
        .stock(1e-3)
        .formula(vec(2, -kGravity * 0.5, 0), 1e-3)
        .absent("impulses written back", "there are none");
}

} // namespace
