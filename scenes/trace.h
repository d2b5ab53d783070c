// Where the time of a run went, piece by piece: a trace in the format of Chrome's trace events, which https://ui.perfetto.dev and
// chrome://tracing show.
//
//   one lane for each thread that worked, "steps" the one that steps the world; in it frames, in these what engine/slice.h tells
//   memory: 48 bytes a slice, about 150 in the file
//   threads: it is told by any; all else by the thread that steps the world
#pragma once

#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "engine/slice.h"

namespace islet {

class Trace {
 public:
  Trace();
  ~Trace();
  Trace(const Trace&) = delete;
  Trace& operator=(const Trace&) = delete;

  void Begin();                                         // it is told from now on
  void AddFrame(int number, double begin, double end);  // [s] of engine/stopwatch.h

  std::string Json() const;

 private:
  struct Entry {
    Slice slice;
    int lane;
  };
  void Add(const Slice& slice);

  const SliceObserver observer_;
  double start_;  // [s] where the trace's time begins
  std::mutex mutex_;
  std::map<std::thread::id, int> lanes_;
  std::vector<Entry> entries_;
  std::vector<Slice> frames_;  // body: the number
};

}  // namespace islet
