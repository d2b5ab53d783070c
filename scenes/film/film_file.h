// Recordings: a film in a file that grows frame by frame (chunk_file.h, film_head.h and frame_code.h say how).
//
//   in:  a film's head, then its frames       out: the same, bit for bit; every frame that was added before a kill
//   errors: writing: std::runtime_error with path and reason, also for a frame with a number that is not finite; std::invalid_argument for
//           a head that cannot be recorded (a custom shape, more than kMostFilmBodies)
//           reading: std::invalid_argument with path, offset in bytes and what is wrong
//   memory: a reader holds two frames, and checks sizes before it asks for memory
//   threads: a writer or reader belongs to one thread
#pragma once

#include <cstdint>
#include <string>

#include "scenes/film/chunk_file.h"
#include "scenes/film/film.h"

namespace islet {

class FilmWriter {
 public:
  // The file takes its name here, in place of what had it, with the head in it.
  FilmWriter(const std::string& path, const FilmHead& head);
  void Add(const FilmFrame& frame);            // one write; frames come in the order of their numbers and times
  void Finish(const std::string& stopped_by);  // why the run ended; not empty

 private:
  std::string path_;
  std::size_t bodies_;
  ChunkWriter file_;
  FilmFrame before_;  // the last that was added
  int frames_ = 0;
};

// Frame by frame, in the memory of two.
class FilmReader {
 public:
  explicit FilmReader(const std::string& path);

  const FilmHead& head() const { return head_; }
  bool Next(FilmFrame* frame);  // false behind the last whole frame
  // Once Next() said false:
  const std::string& stopped_by() const { return stopped_by_; }  // empty: the recording was cut off
  std::uint64_t left_over() const { return file_.left_over(); }  // [bytes] of a frame that was cut off

 private:
  bool NextChunk(Chunk* chunk);

  ChunkReader file_;
  FilmHead head_;
  FilmFrame before_;
  int frames_ = 0;
  std::string stopped_by_;
};

}  // namespace islet
