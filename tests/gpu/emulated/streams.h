// Streams as queues that run when the host waits, events in them, and captures of them into graphs.
#pragma once
#include "state.h"
#include <chrono>
#include <deque>
#include <thread>
#include <vector>

namespace cairn_emulated {
using Work = std::function<void()>;
using Number = unsigned long long; // of an operation, in the order in which the host enqueued

struct Operation {
    Number number;
    Work work;
};
// A graph's operation, and those that must have run before it.
struct Node {
    Work work;
    std::vector<size_t> after;
};
struct Capture {
    cudaStream_t origin;
    cudaStreamCaptureMode mode;
    std::thread::id thread;
    bool invalid = false;
    std::vector<Node> nodes;
};
// One recording of an event: a place in a stream, or in a capture.
struct Record {
    std::shared_ptr<CUstream_st> stream;
    Number number = 0;
    bool done = false;
    std::chrono::steady_clock::time_point time;
    std::shared_ptr<Capture> capture;
    std::vector<size_t> frontier;
};

std::shared_ptr<CUstream_st> find_stream(cudaStream_t handle); // null: no such stream
cudaError_t enqueue(cudaStream_t stream, Work work);
cudaError_t finish(cudaStream_t stream);
cudaError_t finish_all();
// Whether a capture is going on that this call would spoil; it then has.
bool capture_forbids_waiting();
bool is_capturing(cudaStream_t stream);

// Between streams.cpp and graphs.cpp.
extern std::vector<std::shared_ptr<Capture>> captures;  // those that go on
cudaError_t spoil(Capture& capture, cudaError_t error); // makes it invalid, for this reason
std::vector<std::shared_ptr<CUstream_st>> all_streams();
void run_work(const Work& work); // unless the device is broken
void run_graph(const std::vector<Node>& nodes);
} // namespace cairn_emulated

struct CUstream_st {
    bool blocking = true; // ordered with the null stream
    std::deque<cairn_emulated::Operation> queue;
    bool asked = false; // a query has been answered with "not ready"
    std::shared_ptr<cairn_emulated::Capture> capture;
    std::vector<size_t> frontier; // of the capture: what the next operation comes after
};
struct CUevent_st {
    bool timing = true;
    bool asked = false;
    std::shared_ptr<cairn_emulated::Record> record;
};
