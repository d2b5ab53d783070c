#include "scenes/run_page.h"

#include <fmt/format.h>

#include <filesystem>
#include <stdexcept>
#include <utility>

namespace islet {

RunPage::RunPage(const std::string& path, FilmHead head, const PageOptions& options)
    : path_(path), head_(std::move(head)), file_(path), writer_(&file_.stream(), head_, options) {}

std::string RunPage::Finish(const std::string& stopped_by) {
  writer_.Finish(stopped_by);
  const auto bytes = static_cast<double>(file_.stream().tellp());
  file_.Commit();
  return fmt::format("page                {}: {:.1f} MB, opens in a browser\n", path_, bytes / 1e6);
}

}  // namespace islet
