// The small world of tests/conformance with its arrays in device memory.
#pragma once
#include "../conformance/small_world.h"
#include "core/scene/fields.h"

#include <cuda_runtime.h>

#include <algorithm>
#include <vector>

// Which views are on the device: all, or those of every other field, so that host and device memory mix in a table. A result is where
// the input is that it overwrites.
enum class Where { all, even, odd };

inline void succeed(cudaError_t error) { ASSERT_EQ(error, cudaSuccess) << cudaGetErrorString(error); }

// Device memory for a step: an image of the world, and of every other array that a view shows.
class Moving {
  public:
    Moving(const SmallWorld& world, Where where) : world_(world), where_(where) { image_ = copy(&world, sizeof world); }
    ~Moving() {
        for (std::byte* memory : memory_)
            succeed(cudaFree(memory));
    }
    Moving(const Moving&) = delete;
    Moving& operator=(const Moving&) = delete;

    void operator()(cairn_view& view, std::size_t count, std::size_t components) {
        const auto offset = static_cast<const std::byte*>(view.data) - reinterpret_cast<const std::byte*>(&world_);
        if (view.data == nullptr || (where_ != Where::all && (offset / 8) % 2 != (where_ == Where::odd ? 1 : 0)))
            return;
        view.device = CAIRN_DEVICE;
        if (offset >= 0 && offset < static_cast<std::ptrdiff_t>(sizeof world_)) {
            view.data = image_ + offset;
            return;
        }
        const auto length = components * cairn::size_of(static_cast<cairn::Type>(view.type));
        const std::ptrdiff_t span =
            static_cast<std::ptrdiff_t>(count - 1) * (view.stride == 0 ? static_cast<std::ptrdiff_t>(length) : view.stride);
        const std::ptrdiff_t low = std::min<std::ptrdiff_t>(span, 0);
        view.data = copy(static_cast<const std::byte*>(view.data) + low, static_cast<std::size_t>(span - 2 * low) + length) - low;
    }
    const std::byte* image() const { return image_; }

  private:
    std::byte* copy(const void* from, std::size_t size) {
        std::byte* to = nullptr;
        succeed(cudaMalloc(&to, size));
        succeed(cudaMemcpy(to, from, size, cudaMemcpyHostToDevice));
        memory_.push_back(to);
        return to;
    }
    const SmallWorld& world_;
    Where where_;
    std::vector<std::byte*> memory_;
    std::byte* image_ = nullptr;
};

// Tables of `world` whose views show copies in device memory, as far as `where` says.
class DeviceWorld {
  public:
    explicit DeviceWorld(SmallWorld& world, Where where = Where::all)
        : moved_(world, where), world_(world), bodies(world.body_table), contacts(world.contact_table), joints(world.joint_table),
          rows(world.row_table), results(world.results), step(world.step) {
        for (const auto& field : cairn::kBodyTable)
            moved_(bodies.*field.view, bodies.count, field.components);
        for (const auto& field : cairn::kContactTable)
            moved_(contacts.*field.view, contacts.count, field.components);
        for (const auto& field : cairn::kJointTable)
            moved_(joints.*field.view, joints.count, field.components);
        for (const auto& field : cairn::kRowTable)
            moved_(rows.*field.view, rows.count, field.components);
        for (const auto& field : cairn::kResultTable)
            moved_(results.*field.view, count_of(field), field.components);
        step.bodies = step.bodies == nullptr ? nullptr : &bodies;
        step.contacts = &contacts;
        step.joints = &joints;
        step.rows = &rows;
    }

    // Results on the device, back to where they came from.
    void fetch() {
        SmallWorld after;
        succeed(cudaMemcpy(static_cast<void*>(&after), moved_.image(), sizeof after, cudaMemcpyDeviceToHost));
        for (const auto& field : cairn::kResultTable) {
            const cairn_view& view = results.*field.view;
            for (std::size_t i = 0; view.device == CAIRN_DEVICE && i < count_of(field); ++i) {
                const auto at = static_cast<const std::byte*>(view.data) - moved_.image() + static_cast<std::ptrdiff_t>(i) * view.stride;
                std::memcpy(reinterpret_cast<std::byte*>(&world_) + at, reinterpret_cast<const std::byte*>(&after) + at,
                            field.components * sizeof(double));
            }
        }
    }

  private:
    std::size_t count_of(const cairn::ResultField& field) const {
        const std::size_t counts[] = {bodies.count, contacts.count, joints.count, rows.count};
        return counts[static_cast<std::size_t>(field.of)];
    }
    Moving moved_;
    SmallWorld& world_;

  public:
    cairn_bodies bodies;
    cairn_contacts contacts;
    cairn_joints joints;
    cairn_rows rows;
    cairn_results results;
    cairn_step step;
};
