#include "scenes/viewer/page.h"

#include <algorithm>
#include <ostream>
#include <stdexcept>

#include "scenes/viewer/bundle.h"
#include "scenes/viewer/deflate.h"
#include "scenes/viewer/page_head.h"

namespace islet {
namespace {

constexpr size_t kPosesAChunk = 32768;
constexpr size_t kFewestContacts = 32;  // of a frame, whatever the budget

// Base64 has no letter that HTML or a script would mind.
std::string Block(const std::string& id, std::string_view bytes) {
  return "<script type=\"text/plain\" id=\"" + id + "\">" + Base64(Deflate(bytes)) + "</script>\n";
}

}  // namespace

PageWriter::PageWriter(std::ostream* out, const FilmHead& head, const PageOptions& options)
    : out_(*out), head_(head), options_(options) {
  CheckPageHead(head);
  position_step_ = PositionStep(head);
  frames_a_chunk_ = std::clamp<size_t>(kPosesAChunk / std::max<size_t>(head.bodies.size(), 1), 4, 128);
  const std::string_view page = ViewerPage();
  Put(std::string(page.substr(0, page.find(kDataMark))));
}

void PageWriter::Put(const std::string& text) {
  if (!out_.write(text.data(), static_cast<std::streamsize>(text.size())))
    throw std::runtime_error("cannot write the page");
}

void PageWriter::Add(const FilmFrame& frame) {
  CheckPageFrame(head_, frame);
  AppendNumbers(frame, &numbers_);
  frames_.push_back(frame);
  if (frames_.size() == frames_a_chunk_) WriteChunk();
}

void PageWriter::WriteChunk() {
  if (frames_.empty()) return;
  int done = 0;
  for (const int frames : chunk_sizes_) done += frames;
  const size_t frames = frames_.size();
  const size_t left = std::max<size_t>(static_cast<size_t>(std::max(options_.expected_frames - done, 0)), frames);
  const double share = static_cast<double>(frames) / static_cast<double>(left);
  const double bytes =
      share * static_cast<double>(options_.contact_bytes - std::min(contact_bytes_, options_.contact_bytes));
  const auto most = static_cast<size_t>(bytes / contact_size_ / static_cast<double>(frames));

  const PageChunk chunk = EncodePageChunk(head_, frames_, position_step_, std::max(most, kFewestContacts));
  const std::string number = std::to_string(chunk_sizes_.size());
  const std::string contacts = Block("contacts" + number, chunk.contacts);
  Put(Block("bodies" + number, chunk.bodies));
  Put(contacts);

  contact_bytes_ += contacts.size();
  if (chunk.contacts_kept > 1000)
    contact_size_ = static_cast<double>(contacts.size()) / static_cast<double>(chunk.contacts_kept);
  chunk_sizes_.push_back(chunk.frames);
  sum_.frames += chunk.frames;
  sum_.position_error = std::max(sum_.position_error, chunk.position_error);
  sum_.rotation_error = std::max(sum_.rotation_error, chunk.rotation_error);
  sum_.contacts_kept += chunk.contacts_kept;
  sum_.contacts_all += chunk.contacts_all;
  sum_.frames_cut += chunk.frames_cut;
  frames_.clear();
}

void PageWriter::Finish(const std::string& stopped_by) {
  WriteChunk();
  if (sum_.frames == 0) throw std::invalid_argument("the film has no frame");
  Put(Block("numbers", NumberBytes(numbers_)));
  const bool worst = options_.start == PageStart::kWorstFrame;
  Put("<script type=\"application/json\" id=\"head\">" +
      PageHeadJson(head_, sum_, chunk_sizes_, position_step_, stopped_by, worst ? "worst" : "beginning") +
      "</script>\n");
  const std::string_view page = ViewerPage();
  Put(std::string(page.substr(page.find(kDataMark) + kDataMark.size())));
  if (!out_.flush()) throw std::runtime_error("cannot write the page");
}

}  // namespace islet
