// A film as one page that a browser shows without a server and without a network.
//
//   in:  a film's head, then its frames as they come     out: a page of HTML, written piece by piece
//   memory: the frames of one chunk (about 32,000 poses), and 200 bytes a frame for the curves
//   What is kept exactly: the curves' numbers. What is not: poses and contacts, see page_chunk.h; the page tells the largest error.
//   Of the contacts those that press most are kept, so that all of them together take about contact_bytes; the page tells how many.
//   errors: std::invalid_argument that names frame and body of what is no film; std::runtime_error if the stream fails
//   threads: one page by one thread
#pragma once

#include <iosfwd>
#include <string>
#include <vector>

#include "scenes/film/film.h"
#include "scenes/viewer/page_chunk.h"

namespace islet {

// Where the page opens.
enum class PageStart {
  kBeginning,   // at frame 0
  kWorstFrame,  // at the first failed step, else where the accuracy is worst; with the table of the run's numbers
};

struct PageOptions {
  PageStart start = PageStart::kBeginning;
  int expected_frames = 0;            // among which contact_bytes are shared; a guess
  size_t contact_bytes = 10'000'000;  // of the page
};

class PageWriter {
 public:
  // The head and the stream must live as long as the writer.
  PageWriter(std::ostream* out, const FilmHead& head, const PageOptions& options);

  void Add(const FilmFrame& frame);
  void Finish(const std::string& stopped_by);  // after which the page is whole

 private:
  void WriteChunk();
  void Put(const std::string& text);

  std::ostream& out_;
  const FilmHead& head_;
  PageOptions options_;
  double position_step_;
  size_t frames_a_chunk_;
  std::vector<FilmFrame> frames_;  // of the chunk
  std::vector<double> numbers_;    // of all frames, see page_head.h
  std::vector<int> chunk_sizes_;   // [frames]
  PageChunk sum_;                  // of what the chunks tell; no bytes
  size_t contact_bytes_ = 0;       // that were used
  double contact_size_ = 16;       // [bytes] of the page that a contact took in the last chunk
};

}  // namespace islet
