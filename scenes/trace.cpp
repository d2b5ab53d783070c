#include "scenes/trace.h"

#include <fmt/format.h>

#include <cmath>
#include <iterator>

#include "engine/stopwatch.h"

namespace islet {
namespace {

using Text = std::back_insert_iterator<std::string>;

// Whole nanoseconds, so that what nests in the engine nests in the file.
std::string Times(const Slice& slice, double start) {
  const auto nanoseconds = [&](double time) { return std::llround(1e9 * (time - start)); };
  const long long begin = nanoseconds(slice.begin), length = nanoseconds(slice.end) - begin;
  return fmt::format("\"ts\":{}.{:03},\"dur\":{}.{:03}", begin / 1000, begin % 1000, length / 1000, length % 1000);
}

}  // namespace

Trace::Trace() : observer_([this](const Slice& slice) { Add(slice); }), start_(Seconds()) {
  lanes_.emplace(std::this_thread::get_id(), 0);
}

Trace::~Trace() { slice_observer = nullptr; }

void Trace::Begin() { slice_observer = &observer_; }

void Trace::Add(const Slice& slice) {
  const std::lock_guard lock(mutex_);
  const auto lane = lanes_.emplace(std::this_thread::get_id(), static_cast<int>(lanes_.size())).first;
  entries_.push_back({slice, lane->second});
}

void Trace::AddFrame(int number, double begin, double end) { frames_.push_back({"frame", begin, end, number, 0}); }

std::string Trace::Json() const {
  std::string text = "{\"displayTimeUnit\":\"ms\",\"traceEvents\":[\n";
  Text out(text);
  fmt::format_to(out, "{{\"name\":\"process_name\",\"ph\":\"M\",\"pid\":1,\"tid\":0,\"args\":{{\"name\":\"islet\"}}}}");
  for (const auto& [thread, lane] : lanes_) {
    const std::string name = lane == 0 ? "steps" : fmt::format("worker {}", lane);
    fmt::format_to(out,
                   ",\n{{\"name\":\"thread_name\",\"ph\":\"M\",\"pid\":1,\"tid\":{},\"args\":{{\"name\":\"{}\"}}}}",
                   lane, name);
  }
  for (const Slice& frame : frames_)
    fmt::format_to(out, ",\n{{\"name\":\"frame\",\"ph\":\"X\",\"pid\":1,\"tid\":0,{},\"args\":{{\"frame\":{}}}}}",
                   Times(frame, start_), frame.body);
  for (const Entry& entry : entries_) {
    const Slice& slice = entry.slice;
    fmt::format_to(out, ",\n{{\"name\":\"{}\",\"ph\":\"X\",\"pid\":1,\"tid\":{},{}", slice.name, entry.lane,
                   Times(slice, start_));
    if (slice.body >= 0) fmt::format_to(out, ",\"args\":{{\"body\":{},\"contacts\":{}}}", slice.body, slice.contacts);
    text += '}';
  }
  return text + "\n]}\n";
}

}  // namespace islet
