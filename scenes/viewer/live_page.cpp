#include "scenes/viewer/live_page.h"

#include <vector>

#include "scenes/viewer/bundle.h"
#include "scenes/viewer/deflate.h"
#include "scenes/viewer/page_chunk.h"
#include "scenes/viewer/page_head.h"

namespace islet {
namespace {

// Of a frame, those that press most: 150 kB of a line, which a browser takes apart within its 16 ms.
constexpr size_t kMostContacts = 10'000;

}  // namespace

std::string LivePage() {
  const std::string_view page = ViewerPage();
  const size_t mark = page.find(kDataMark);
  return std::string(page.substr(0, mark)) + "<script type=\"text/plain\" id=\"live\"></script>\n" +
         std::string(page.substr(mark + kDataMark.size()));
}

std::string LiveHead(const FilmHead& head, double position_step) {
  CheckPageHead(head);
  return PageHeadJson(head, {}, {}, position_step, "", "live");
}

std::string LiveFrame(const FilmHead& head, const FilmFrame& frame, double position_step) {
  CheckPageFrame(head, frame);
  std::vector<double> numbers;
  AppendNumbers(frame, &numbers);
  const PageChunk chunk = EncodePageChunk(head, {&frame, 1}, position_step, kMostContacts);
  return Base64(Deflate(chunk.bodies)) + " " + Base64(Deflate(chunk.contacts)) + " " + Base64(NumberBytes(numbers));
}

}  // namespace islet
