// Gazebo's Bullet engine without Gazebo: loads an SDF world into the plugin that Debian packages, and steps it. It knows nothing of
// Cairn, and nothing of Bullet either: the plugin is linked to the shared library. Run it as it is, and under cairn-run.
//     gazebo_falling WORLD.sdf [SECONDS [STEP]]
#include <ignition/physics/ConstructEmpty.hh>
#include <ignition/physics/ForwardStep.hh>
#include <ignition/physics/FrameSemantics.hh>
#include <ignition/physics/GetEntities.hh>
#include <ignition/physics/Joint.hh>
#include <ignition/physics/RequestEngine.hh>
#include <ignition/physics/sdf/ConstructCollision.hh>
#include <ignition/physics/sdf/ConstructJoint.hh>
#include <ignition/physics/sdf/ConstructLink.hh>
#include <ignition/physics/sdf/ConstructModel.hh>
#include <ignition/physics/sdf/ConstructWorld.hh>
#include <ignition/plugin/Loader.hh>

#include <sdf/Joint.hh>
#include <sdf/Link.hh>
#include <sdf/Model.hh>
#include <sdf/Root.hh>
#include <sdf/World.hh>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

namespace physics = ignition::physics;

namespace {

using Features = physics::FeatureList<physics::LinkFrameSemantics, physics::ForwardStep, physics::sdf::ConstructSdfWorld,
                                      physics::sdf::ConstructSdfModel, physics::sdf::ConstructSdfLink, physics::sdf::ConstructSdfJoint,
                                      physics::sdf::ConstructSdfCollision>;
using Link = physics::Link3dPtr<Features>;

struct Named {
    std::string name;
    Link link;
};

struct Hinge { // where it stands on each of its links
    Link parent, child;
    Eigen::Vector3d onParent, onChild;
};

double seconds(std::chrono::steady_clock::duration duration) { return std::chrono::duration<double>(duration).count(); }

Eigen::Isometry3d pose(const Link& link) { return link->FrameDataRelativeToWorld().pose; }

int fail(const std::string& text) {
    std::fprintf(stderr, "gazebo_falling: %s\n", text.c_str());
    return 1;
}

} // namespace

int main(int argc, char** argv) {
    if (argc < 2)
        return fail("usage: gazebo_falling WORLD.sdf [SECONDS [STEP]]");
    const double length = argc > 2 ? std::atof(argv[2]) : 10, dt = argc > 3 ? std::atof(argv[3]) : 1.0 / 60;
    if (!(length > 0) || !(dt > 0))
        return fail("the times must be above 0");
    sdf::Root root;
    for (const sdf::Error& error : root.Load(argv[1]))
        return fail(error.Message());
    const sdf::World* description = root.WorldByIndex(0);
    if (description == nullptr)
        return fail(std::string("no world in ") + argv[1]);

    ignition::plugin::Loader loader;
    loader.LoadLib(GAZEBO_BULLET_PLUGIN);
    const auto plugin = loader.Instantiate("ignition::physics::bullet::Plugin");
    const auto engine = physics::RequestEngine3d<Features>::From(plugin);
    if (!engine)
        return fail(std::string("no Bullet engine in ") + GAZEBO_BULLET_PLUGIN);
    // This engine gives no handles to what a world was made with, so make it one by one.
    sdf::World empty = *description;
    empty.ClearModels();
    const auto world = engine->ConstructWorld(empty);

    std::vector<Named> boxes;
    std::vector<Hinge> hinges;
    for (uint64_t m = 0; m < description->ModelCount(); ++m) {
        const sdf::Model& model = *description->ModelByIndex(m);
        sdf::Model frame = model;
        frame.ClearLinks();
        frame.ClearJoints();
        const auto made = world->ConstructModel(frame);
        std::vector<Named> links;
        for (uint64_t i = 0; i < model.LinkCount(); ++i)
            links.push_back({model.LinkByIndex(i)->Name(), made->ConstructLink(*model.LinkByIndex(i))});
        if (model.Name().compare(0, 4, "box_") == 0)
            boxes.push_back({model.Name(), links[0].link});
        for (uint64_t i = 0; i < model.JointCount(); ++i) {
            const sdf::Joint& joint = *model.JointByIndex(i);
            if (!made->ConstructJoint(joint))
                return fail("the engine does not take the joint " + joint.Name());
            Hinge hinge;
            for (const Named& candidate : links) {
                if (candidate.name == joint.ParentLinkName())
                    hinge.parent = candidate.link;
                if (candidate.name == joint.ChildLinkName())
                    hinge.child = candidate.link;
            }
            const ignition::math::Vector3d& place = joint.RawPose().Pos(); // in the child's frame
            hinge.onChild = Eigen::Vector3d(place.X(), place.Y(), place.Z());
            hinge.onParent = pose(hinge.parent).inverse() * (pose(hinge.child) * hinge.onChild);
            hinges.push_back(hinge);
        }
    }

    physics::ForwardStep::Output output;
    physics::ForwardStep::State state;
    physics::ForwardStep::Input input;
    const auto step = std::chrono::duration_cast<std::chrono::steady_clock::duration>(std::chrono::duration<double>(dt));
    input.Get<std::chrono::steady_clock::duration>() = step;
    const int steps = std::max(1, static_cast<int>(length / dt));
    double taken = 0, gap = 0;
    std::vector<Eigen::Vector3d> halfway;
    for (int i = 0; i < steps; ++i) {
        if (i == steps / 2)
            for (const Named& box : boxes)
                halfway.push_back(pose(box.link).translation());
        const auto begin = std::chrono::steady_clock::now();
        world->Step(output, state, input);
        taken += seconds(std::chrono::steady_clock::now() - begin);
        for (const Hinge& hinge : hinges)
            gap = std::max(gap, (pose(hinge.parent) * hinge.onParent - pose(hinge.child) * hinge.onChild).norm());
    }
    double lowest = 1e9, highest = -1e9, crept = 0;
    for (std::size_t i = 0; i < boxes.size(); ++i) {
        const Eigen::Vector3d place = pose(boxes[i].link).translation();
        lowest = std::min(lowest, place.z());
        highest = std::max(highest, place.z());
        crept = std::max(crept, (place - halfway[i]).norm());
    }
    std::printf("%d steps of %.2f ms: %.3f ms each\n", steps, 1e3 * dt, 1e3 * taken / steps);
    std::printf("boxes: lowest %.4f m, highest %.4f m; the second half of the run moved one by %.3f mm at most\n", lowest, highest,
                1e3 * crept);
    std::printf("hinges: widest gap %.3f mm\n", 1e3 * gap);
    return 0;
}
