// Captures of streams into graphs, and graphs.
#include "streams.h"
#include <algorithm>
#include <set>

namespace cairn_emulated {
std::vector<std::shared_ptr<Capture>> captures;

cudaError_t spoil(Capture& capture, cudaError_t error) {
    capture.invalid = true;
    return error;
}

bool capture_forbids_waiting() {
    bool forbids = false;
    for (const auto& capture : captures)
        if (capture->mode == cudaStreamCaptureModeGlobal ||
            (capture->mode == cudaStreamCaptureModeThreadLocal && capture->thread == std::this_thread::get_id())) {
            capture->invalid = true;
            forbids = true;
        }
    return forbids;
}

void run_graph(const std::vector<Node>& nodes) {
    std::vector<size_t> waits_for(nodes.size()), ready_nodes;
    std::vector<std::vector<size_t>> before(nodes.size());
    for (size_t i = 0; i < nodes.size(); i++) {
        waits_for[i] = nodes[i].after.size();
        for (const size_t j : nodes[i].after)
            before[j].push_back(i);
        if (waits_for[i] == 0)
            ready_nodes.push_back(i);
    }
    while (!ready_nodes.empty()) {
        auto at = state.order == Order::forward    ? std::min_element(ready_nodes.begin(), ready_nodes.end())
                  : state.order == Order::reversed ? std::max_element(ready_nodes.begin(), ready_nodes.end())
                                                   : ready_nodes.begin() + static_cast<std::ptrdiff_t>(random_below(ready_nodes.size()));
        const size_t node = *at;
        *at = ready_nodes.back();
        ready_nodes.pop_back();
        run_work(nodes[node].work);
        for (const size_t next : before[node])
            if (--waits_for[next] == 0)
                ready_nodes.push_back(next);
    }
}

namespace {
bool all_joined(const Capture& capture, const std::vector<size_t>& frontier) {
    std::vector<bool> seen(capture.nodes.size());
    std::vector<size_t> left = frontier;
    while (!left.empty()) {
        const size_t node = left.back();
        left.pop_back();
        if (seen[node])
            continue;
        seen[node] = true;
        left.insert(left.end(), capture.nodes[node].after.begin(), capture.nodes[node].after.end());
    }
    return std::find(seen.begin(), seen.end(), false) == seen.end();
}
} // namespace
} // namespace cairn_emulated

using namespace cairn_emulated;

struct CUgraph_st {
    std::vector<Node> nodes;
};
struct CUgraphExec_st {
    std::shared_ptr<const std::vector<Node>> nodes;
};
namespace {
std::set<cudaGraph_t> graphs;
std::set<cudaGraphExec_t> executables;
} // namespace

cudaError_t cudaStreamBeginCapture(cudaStream_t handle, cudaStreamCaptureMode mode) {
    return api_call([&] {
        const auto stream = find_stream(handle);
        if (!stream)
            return cudaErrorInvalidResourceHandle;
        if (!handle)
            return cudaErrorStreamCaptureUnsupported;
        if (stream->capture)
            return spoil(*stream->capture, cudaErrorInvalidValue);
        stream->capture = std::make_shared<Capture>(Capture{handle, mode, std::this_thread::get_id(), false, {}});
        stream->frontier.clear();
        captures.push_back(stream->capture);
        return cudaSuccess;
    });
}

cudaError_t cudaStreamEndCapture(cudaStream_t handle, cudaGraph_t* graph) {
    return api_call([&] {
        const auto stream = find_stream(handle);
        if (!stream)
            return cudaErrorInvalidResourceHandle;
        if (!graph)
            return cudaErrorInvalidValue;
        *graph = nullptr;
        const auto capture = stream->capture;
        if (!capture)
            return cudaErrorInvalidValue;
        if (capture->origin != handle)
            return spoil(*capture, cudaErrorStreamCaptureUnmatched);
        if (capture->mode != cudaStreamCaptureModeRelaxed && capture->thread != std::this_thread::get_id())
            return spoil(*capture, cudaErrorStreamCaptureWrongThread);
        const bool joined = all_joined(*capture, stream->frontier);
        captures.erase(std::find(captures.begin(), captures.end(), capture));
        for (const auto& other : all_streams())
            if (other->capture == capture)
                other->capture = nullptr;
        if (capture->invalid)
            return cudaErrorStreamCaptureInvalidated;
        if (!joined)
            return cudaErrorStreamCaptureUnjoined;
        *graph = new CUgraph_st{capture->nodes};
        graphs.insert(*graph);
        return cudaSuccess;
    });
}

cudaError_t cudaStreamIsCapturing(cudaStream_t handle, cudaStreamCaptureStatus* status) {
    return api_call([&] {
        const auto stream = find_stream(handle);
        if (!stream)
            return cudaErrorInvalidResourceHandle;
        *status = !stream->capture           ? cudaStreamCaptureStatusNone
                  : stream->capture->invalid ? cudaStreamCaptureStatusInvalidated
                                             : cudaStreamCaptureStatusActive;
        return cudaSuccess;
    });
}

cudaError_t cudaGraphInstantiate(cudaGraphExec_t* exec, cudaGraph_t graph, unsigned long long flags) {
    return api_call([&] {
        if (!exec || !graphs.contains(graph) || flags != 0)
            return cudaErrorInvalidValue;
        *exec = new CUgraphExec_st{std::make_shared<const std::vector<Node>>(graph->nodes)};
        executables.insert(*exec);
        return cudaSuccess;
    });
}

cudaError_t cudaGraphUpload(cudaGraphExec_t exec, cudaStream_t stream) {
    return api_call([&] { return executables.contains(exec) && find_stream(stream) ? cudaSuccess : cudaErrorInvalidValue; });
}

cudaError_t cudaGraphLaunch(cudaGraphExec_t exec, cudaStream_t stream) {
    return api_call([&] {
        if (!executables.contains(exec))
            return cudaErrorInvalidValue;
        if (is_capturing(stream))
            return cudaErrorStreamCaptureUnsupported; // CUDA would make it a child graph
        state.counters.graph_launches++;
        return enqueue(stream, [nodes = exec->nodes] { run_graph(*nodes); });
    });
}

cudaError_t cudaGraphExecDestroy(cudaGraphExec_t exec) {
    return api_release([&] {
        if (executables.erase(exec) == 0)
            return cudaErrorInvalidValue;
        delete exec;
        return cudaSuccess;
    });
}

cudaError_t cudaGraphDestroy(cudaGraph_t graph) {
    return api_release([&] {
        if (graphs.erase(graph) == 0)
            return cudaErrorInvalidValue;
        delete graph;
        return cudaSuccess;
    });
}
