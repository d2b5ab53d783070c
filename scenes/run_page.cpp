#include "scenes/run_page.h"

#include <fmt/format.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <utility>

namespace islet {

template <typename Write>
void RunPage::Try(const Write& write) {
  if (error_) return;
  errno = 0;
  try {
    write();
  } catch (const std::exception&) {
    const std::string reason = std::strerror(errno);
    error_ = file_.stream() ? std::current_exception()
                            : std::make_exception_ptr(std::runtime_error("cannot write " + path_ + ": " + reason));
  }
}

RunPage::RunPage(const std::string& path, FilmHead head, const PageOptions& options)
    : path_(path), head_(std::move(head)), file_(path) {
  Try([&] { writer_.emplace(&file_.stream(), head_, options); });
}

void RunPage::Add(const FilmFrame& frame) {
  Try([&] { writer_->Add(frame); });
}

std::string RunPage::Finish(const std::string& stopped_by) {
  double bytes = 0;
  Try([&] {
    writer_->Finish(stopped_by);
    bytes = static_cast<double>(file_.stream().tellp());
  });
  if (error_) std::rethrow_exception(error_);
  file_.Commit();
  return fmt::format("page                {}: {:.1f} MB; open it in a browser\n", path_, bytes / 1e6);
}

}  // namespace islet
