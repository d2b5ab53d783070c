// Ctrl-C (SIGINT) and SIGTERM: the first asks the run to end in order, the second ends the process at once with exit status 130.
//
//   rule: who works in a loop asks between two pieces of work; nothing is torn in the middle
//   A signal that the process was started to ignore (nohup, a shell's background job) stays ignored.
//   threads: one Interrupt at a time; Asked from anywhere
#pragma once

namespace islet {

class Interrupt {
 public:
  static constexpr int kExitStatus = 130;  // as shells count: 128 + SIGINT

  // what: that is done before the end, as "ends after the frame under way"; must outlive this.
  explicit Interrupt(const char* what);
  ~Interrupt();  // the signals mean again what they meant before
  Interrupt(const Interrupt&) = delete;
  Interrupt& operator=(const Interrupt&) = delete;

  // Whether to end. Who asks obeys.
  static bool Asked();
  // Whether Asked() has ever said yes: a signal that came after the last question changed nothing.
  static bool Obeyed();
};

}  // namespace islet
