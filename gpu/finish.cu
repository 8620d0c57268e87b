#include "finish.h"

#include "../core/scene/unpack.h"

namespace cairn::gpu {

namespace {

struct Finish {
    Layout d;
    Counts n;
    __device__ bool stopped() const { return d.report->bad_input != 0; }
    __device__ const Request& request() const { return *d.request; }
};

// Results: nothing is written if a body is lost.
struct Write : Finish {
    __device__ bool stopped() const { return d.report->bad_input != 0 || d.report->not_finite != 0; }
};

struct CheckFinite : Finish {
    __device__ void operator()(u32 i) const {
        if (d.body_kind[i] != kMovableBody)
            return;
        const std::size_t at = 8 * static_cast<std::size_t>(d.body_row[i]);
        if (!is_finite(d.velocity + at, d.displacement + at))
            atomicMax(&d.report->not_finite, n.bodies - i); // the largest is the first body
        if (d.clamped[d.body_row[i]] > 0)
            atomicAdd(&d.report->rotation_clamped, d.clamped[d.body_row[i]]);
    }
};
struct CountSweeps : Finish {
    __device__ void operator()(u32 i) const {
        if (i >= d.report->islands)
            return;
        const Control<float>& c = d.control[i];
        for (u32 phase = 0; phase < 3; ++phase)
            atomicMax(&d.report->sweeps[phase], c.sweeps[phase]);
        atomicMax(&d.report->any_sweeps, c.sweeps[0] + c.sweeps[1]);
    }
};
struct SumEnergy : Finish {
    __device__ void operator()(u32 chunk) const {
        double sum = 0;
        for (u32 i = chunk * kEnergyChunk; i < n.bodies && i < (chunk + 1) * kEnergyChunk; ++i)
            sum += d.body_kind[i] == kMovableBody ? d.energy_change[d.body_row[i]] : 0.0;
        d.energy_chunk[chunk] = sum;
    }
};
struct WriteBody : Write {
    __device__ void operator()(u32 i) const {
        if (d.body_kind[i] != kMovableBody)
            return;
        const std::size_t at = 8 * static_cast<std::size_t>(d.body_row[i]);
        write_body(request().input.bodies, request().output, i, d.velocity + at, d.displacement + at);
    }
};
// Elements without effect; lanes write over the others.
struct ClearContact : Write {
    __device__ void operator()(u32 i) const { clear_contact(request().output, i); }
};
struct ClearJoint : Write {
    __device__ void operator()(u32 i) const { clear_joint(request().output, i); }
};
struct ClearRow : Write {
    __device__ void operator()(u32 i) const { clear_row(request().output, i); }
};
struct WriteLane : Write {
    __device__ void operator()(u32 lane) const {
        const u32 head = d.lane_head[lane];
        if (head == kNone)
            return;
        const Output& output = request().output;
        const bool special = head < d.joint_base() && contact_group_of(d.lane_shape[lane]).special();
        for (u32 p = 0; p < d.lane_count[lane]; ++p) {
            const u32 place = d.lane_first[lane] + p * d.lane_stride[lane];
            if (head < d.joint_base())
                write_contact(output, head + p, fields_at(d.contact, kContactFields, place),
                              fields_at(d.contact_cold, kContactColdFields, place),
                              special ? fields_at(d.contact_extra, kContactExtraFields, place) : nullptr);
            else if (head < d.raw_base())
                write_joint(output, head - d.joint_base(), fields_at(d.joint, kJointFields, place),
                            fields_at(d.joint_cold, kJointColdFields, place));
            else
                write_row(output, head - d.raw_base() + p, fields_at(d.raw, kRawFields, place));
        }
    }
};

} // namespace

void finish(const Layout& d, const Counts& n, cudaStream_t stream) {
    const Finish step{d, n};
    loop(stream, n.bodies, CheckFinite{step});
    loop(stream, d.capacity.bodies, CountSweeps{step});
    loop(stream, (n.bodies + kEnergyChunk - 1) / kEnergyChunk, SumEnergy{step});
    loop(stream, n.bodies, WriteBody{{step}});
    loop(stream, n.contacts, ClearContact{{step}});
    loop(stream, n.joints, ClearJoint{{step}});
    loop(stream, n.rows, ClearRow{{step}});
    loop(stream, d.capacity.elements(), WriteLane{{step}});
}

} // namespace cairn::gpu
