// A Bullet world for validation: libbullet's own pipeline and solvers, or Cairn behind it, with figures measured alike.
// Compiled once for each of Bullet's precisions; everything that enters or leaves is in double.
#pragma once
#include <cairn/bullet.hpp>

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace cairn_bullet {

using Vec3 = std::array<double, 3>;
using Quat = std::array<double, 4>; // x, y, z, w
using Mat3 = std::array<double, 9>; // row by row
using Six = std::array<double, 6>;  // tx ty tz rx ry rz

// A frame in space, in double.
struct Frame {
    Mat3 axes; // columns are the frame's axes
    Vec3 origin;
};

struct BodySettings {
    double mass;                 // kg; 0: it cannot move
    std::optional<Vec3> inertia; // kg m^2, principal; absent: the shape's own
    Vec3 position;
    Quat orientation;
    Vec3 linearVelocity, angularVelocity;
    double friction, restitution;
    int group;  // two bodies of the same group other than 0 do not collide; -1: collides with nothing
    Vec3 force; // N, world axes, constant, at the centre of mass
};

enum class JointKind { ball, hinge, slider, fixed, sixDof };

// In Cairn's terms: coordinates of b relative to a in the joint's frame. Axis i is free unless it is locked or limited.
struct JointSettings {
    JointKind kind;
    int bodyA, bodyB;           // -1: the world
    Vec3 anchor, anchorB;       // world points at the start, of a and of b: apart, if the joint starts with an error
    Mat3 axes;                  // world axes of the joint's frame at the start
    Six lower, upper;           // sixDof: equal = locked, lower > upper = free; hinge and slider: the one of the free axis
    Six motorSpeed, motorForce; // force 0: no motor
};

struct ContactColumns {
    std::vector<std::int32_t> bodyA, bodyB; // the normal points from a to b
    std::vector<double> separation, position, normal, impulse, frictionImpulse;
};

class World {
  public:
    // solver: "pgs", "nncg", "dantzig" or "cairn". Throws std::invalid_argument, std::runtime_error.
    World(const Vec3& gravity, const std::string& solver, const cairn_config& config, bool sleeping);
    ~World();

    int addBox(const Vec3& halfExtents, const BodySettings& settings);
    int addSphere(double radius, const BodySettings& settings);
    int addCapsule(double radius, double halfLength, const BodySettings& settings); // about y
    int addHull(const std::vector<Vec3>& points, const BodySettings& settings);     // convex, about the centre of mass
    int addPlane(const Vec3& normal, double offset, const BodySettings& settings);
    int addJoint(const JointSettings& settings);

    // One step of dt, or as many of dt / substeps as stepSimulation(dt, substeps, dt / substeps) makes.
    // Throws std::runtime_error if Cairn refused the step.
    void step(double dt, int substeps);

    std::size_t bodyCount() const;
    void poses(double* to) const;      // 7 a body
    void velocities(double* to) const; // 6 a body
    void setVelocity(int body, const Vec3& linear, const Vec3& angular);
    void removeBody(int body);       // from the world; it keeps its index and its last pose. One that a joint holds is refused
    ContactColumns contacts() const; // as they were found at the start of the last internal step
    // Error of what each joint holds: 2 a joint, m and rad. From the bodies' poses now.
    std::vector<double> jointErrors() const;

    int iterations() const; // of the stock solvers
    void setIterations(int iterations);
    bool splitImpulse() const;
    void setSplitImpulse(bool on);

    double solverSeconds() const; // of the last step: gathering, solving and scattering, stock and Cairn alike
    double stepSeconds() const;

    cairn::bullet::ConstraintSolver* cairn() const; // NULL behind a stock solver

  private:
    struct State;
    std::unique_ptr<State> m_state;
};

} // namespace cairn_bullet
