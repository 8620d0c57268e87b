#include "streams.h"
#include "fault.h"
#include "memory.h"
#include <algorithm>
#include <cfenv>
#include <map>
#include <set>

namespace cairn_emulated {
namespace {
std::map<cudaStream_t, std::shared_ptr<CUstream_st>> streams; // those with a handle, the null stream first
std::vector<std::shared_ptr<CUstream_st>> destroyed;          // with work left
std::set<cudaEvent_t> events;
Number last_number = 0;

std::shared_ptr<CUstream_st>& null_stream() {
    auto& stream = streams[nullptr];
    if (!stream)
        stream = std::make_shared<CUstream_st>();
    return stream;
}

} // namespace

std::vector<std::shared_ptr<CUstream_st>> all_streams() {
    std::vector<std::shared_ptr<CUstream_st>> all = destroyed;
    for (const auto& [handle, stream] : streams)
        all.push_back(stream);
    return all;
}

namespace {
// The device at work: its memory accessible, floating point as the device's whatever the host has set.
class Batch {
  public:
    Batch() {
        std::fegetenv(&host_);
        std::fesetenv(FE_DFL_ENV);
        prepare_thread_for_faults();
    }
    ~Batch() { std::fesetenv(&host_); }
    Batch(const Batch&) = delete;
    Batch& operator=(const Batch&) = delete;

  private:
    std::fenv_t host_;
    DeviceAccess access_;
};

} // namespace

void run_work(const Work& work) {
    if (state.broken != cudaSuccess)
        return;
    if (counts_out(state.fail_work)) {
        state.broken = state.fail_work_with;
        return;
    }
    work();
}

namespace {
// The stream's operations up to this number, and first whatever they wait for.
void run_until(CUstream_st& stream, Number number) {
    while (!stream.queue.empty() && stream.queue.front().number <= number) {
        const Operation next = std::move(stream.queue.front());
        stream.queue.pop_front();
        if (&stream == null_stream().get()) {
            for (const auto& other : all_streams())
                if (other->blocking && other.get() != &stream)
                    run_until(*other, next.number);
        } else if (stream.blocking) {
            run_until(*null_stream(), next.number);
        }
        run_work(next.work);
    }
}

cudaError_t run_for_host(CUstream_st& stream, Number number) {
    if (stream.queue.empty() || stream.queue.front().number > number)
        return state.broken;
    const Batch batch;
    if (state.stream_order == StreamOrder::others_first)
        for (const auto& other : all_streams())
            if (other.get() != &stream)
                run_until(*other, last_number);
    run_until(stream, number);
    return state.broken;
}

bool ready(const Record& record) {
    return record.done || record.stream->queue.empty() || record.stream->queue.front().number > record.number;
}

void unite(std::vector<size_t>& frontier, const std::vector<size_t>& more) {
    for (const size_t node : more)
        if (std::find(frontier.begin(), frontier.end(), node) == frontier.end())
            frontier.push_back(node);
}

} // namespace

std::shared_ptr<CUstream_st> find_stream(cudaStream_t handle) {
    if (!handle)
        return null_stream();
    const auto it = streams.find(handle);
    return it == streams.end() ? nullptr : it->second;
}

bool is_capturing(cudaStream_t handle) {
    const auto stream = find_stream(handle);
    return stream && stream->capture;
}

cudaError_t enqueue(cudaStream_t handle, Work work) {
    const auto stream = find_stream(handle);
    if (!stream)
        return cudaErrorInvalidResourceHandle;
    if (stream->capture) {
        Capture& capture = *stream->capture;
        if (capture.invalid)
            return cudaErrorStreamCaptureInvalidated;
        capture.nodes.push_back({std::move(work), stream->frontier});
        stream->frontier = {capture.nodes.size() - 1};
        return cudaSuccess;
    }
    if (!handle)
        for (const auto& capture : captures)
            if (const auto origin = find_stream(capture->origin); origin && origin->blocking)
                return spoil(*capture, cudaErrorStreamCaptureImplicit);
    stream->queue.push_back({++last_number, std::move(work)});
    stream->asked = false;
    if (state.stream_order == StreamOrder::eager)
        (void)run_for_host(*stream, last_number);
    return cudaSuccess;
}

cudaError_t finish(cudaStream_t handle) {
    const auto stream = find_stream(handle);
    if (!stream)
        return cudaErrorInvalidResourceHandle;
    if (stream->capture)
        return spoil(*stream->capture, cudaErrorStreamCaptureUnsupported);
    state.counters.host_syncs++;
    return run_for_host(*stream, last_number);
}

cudaError_t finish_all() {
    state.counters.host_syncs++;
    const auto all = all_streams();
    if (std::any_of(all.begin(), all.end(), [](const auto& stream) { return !stream->queue.empty(); })) {
        const Batch batch;
        for (const auto& stream : all)
            run_until(*stream, last_number);
    }
    destroyed.clear();
    return state.broken;
}

bool work_is_pending() {
    const std::lock_guard lock(api_mutex());
    const auto all = all_streams();
    return std::any_of(all.begin(), all.end(), [](const auto& stream) { return !stream->queue.empty(); });
}

} // namespace cairn_emulated

using namespace cairn_emulated;

cudaError_t cudaStreamCreateWithFlags(cudaStream_t* stream, unsigned int flags) {
    return api_call([&] {
        if (!stream || flags > cudaStreamNonBlocking)
            return cudaErrorInvalidValue;
        auto made = std::make_shared<CUstream_st>();
        made->blocking = flags != cudaStreamNonBlocking;
        *stream = made.get();
        streams.emplace(made.get(), std::move(made));
        return cudaSuccess;
    });
}
cudaError_t cudaStreamCreate(cudaStream_t* stream) { return cudaStreamCreateWithFlags(stream, cudaStreamDefault); }

cudaError_t cudaStreamDestroy(cudaStream_t handle) {
    return api_release([&] {
        const auto stream = handle ? find_stream(handle) : nullptr;
        if (!stream)
            return cudaErrorInvalidResourceHandle;
        if (stream->capture)
            return spoil(*stream->capture, cudaErrorStreamCaptureUnsupported);
        if (!stream->queue.empty())
            destroyed.push_back(stream);
        streams.erase(handle);
        return cudaSuccess;
    });
}

cudaError_t cudaStreamSynchronize(cudaStream_t stream) {
    return api_call([&] { return capture_forbids_waiting() ? cudaErrorStreamCaptureUnsupported : finish(stream); });
}

cudaError_t cudaDeviceSynchronize() {
    return api_call([&] {
        if (!captures.empty()) {
            for (const auto& capture : captures)
                capture->invalid = true;
            return cudaErrorStreamCaptureUnsupported;
        }
        return finish_all();
    });
}

cudaError_t cudaStreamQuery(cudaStream_t handle) {
    return api_call([&] {
        const auto stream = find_stream(handle);
        if (!stream)
            return cudaErrorInvalidResourceHandle;
        if (stream->capture)
            return spoil(*stream->capture, cudaErrorStreamCaptureUnsupported);
        state.counters.queries++;
        if (!stream->queue.empty() && !std::exchange(stream->asked, true))
            return cudaErrorNotReady;
        return run_for_host(*stream, last_number);
    });
}

cudaError_t cudaStreamWaitEvent(cudaStream_t handle, cudaEvent_t event, unsigned int flags) {
    return api_call([&] {
        const auto stream = find_stream(handle);
        if (!stream || !events.contains(event))
            return cudaErrorInvalidResourceHandle;
        if (flags != 0)
            return cudaErrorInvalidValue;
        const auto record = event->record;
        if (stream->capture) {
            if (!record || record->capture != stream->capture)
                return spoil(*stream->capture, record && record->capture ? cudaErrorStreamCaptureMerge : cudaErrorStreamCaptureIsolation);
            unite(stream->frontier, record->frontier);
            return cudaSuccess;
        }
        if (!record)
            return cudaSuccess;
        if (record->capture) { // the stream joins a capture that still goes on
            if (!handle || std::find(captures.begin(), captures.end(), record->capture) == captures.end())
                return handle ? cudaErrorCapturedEvent : cudaErrorStreamCaptureUnsupported;
            stream->capture = record->capture;
            stream->frontier = record->frontier;
            return cudaSuccess;
        }
        return enqueue(handle, [record] { run_until(*record->stream, record->number); });
    });
}

cudaError_t cudaEventCreateWithFlags(cudaEvent_t* event, unsigned int flags) {
    return api_call([&] {
        if (!event || (flags & ~(cudaEventBlockingSync | cudaEventDisableTiming)) != 0)
            return cudaErrorInvalidValue;
        *event = new CUevent_st;
        (*event)->timing = (flags & cudaEventDisableTiming) == 0;
        events.insert(*event);
        return cudaSuccess;
    });
}
cudaError_t cudaEventCreate(cudaEvent_t* event, unsigned int flags) { return cudaEventCreateWithFlags(event, flags); }
cudaError_t cudaEventCreate(cudaEvent_t* event) { return cudaEventCreateWithFlags(event, cudaEventDefault); }

cudaError_t cudaEventDestroy(cudaEvent_t event) {
    return api_release([&] {
        if (events.erase(event) == 0)
            return cudaErrorInvalidResourceHandle;
        delete event;
        return cudaSuccess;
    });
}

cudaError_t cudaEventRecord(cudaEvent_t event, cudaStream_t handle) {
    return api_call([&] {
        const auto stream = find_stream(handle);
        if (!stream || !events.contains(event))
            return cudaErrorInvalidResourceHandle;
        auto record = std::make_shared<Record>();
        event->record = record;
        event->asked = false;
        if (stream->capture) {
            record->capture = stream->capture;
            record->frontier = stream->frontier;
            return stream->capture->invalid ? cudaErrorStreamCaptureInvalidated : cudaSuccess;
        }
        record->stream = stream;
        record->number = last_number + 1;
        return enqueue(handle, [record] {
            record->done = true;
            record->time = std::chrono::steady_clock::now();
        });
    });
}

cudaError_t cudaEventSynchronize(cudaEvent_t event) {
    return api_call([&] {
        if (!events.contains(event))
            return cudaErrorInvalidResourceHandle;
        if (capture_forbids_waiting())
            return cudaErrorStreamCaptureUnsupported;
        if (!event->record)
            return cudaSuccess;
        if (event->record->capture)
            return cudaErrorCapturedEvent;
        state.counters.host_syncs++;
        return run_for_host(*event->record->stream, event->record->number);
    });
}

cudaError_t cudaEventQuery(cudaEvent_t event) {
    return api_call([&] {
        if (!events.contains(event))
            return cudaErrorInvalidResourceHandle;
        if (!event->record)
            return cudaSuccess;
        if (event->record->capture)
            return cudaErrorCapturedEvent;
        state.counters.queries++;
        if (!ready(*event->record) && !std::exchange(event->asked, true))
            return cudaErrorNotReady;
        return run_for_host(*event->record->stream, event->record->number);
    });
}

cudaError_t cudaEventElapsedTime(float* ms, cudaEvent_t start, cudaEvent_t end) {
    return api_call([&] {
        if (!ms || !events.contains(start) || !events.contains(end) || !start->timing || !end->timing || !start->record || !end->record)
            return cudaErrorInvalidResourceHandle;
        if (!start->record->done || !end->record->done)
            return cudaErrorNotReady;
        *ms = std::chrono::duration<float, std::milli>(end->record->time - start->record->time).count();
        return cudaSuccess;
    });
}
