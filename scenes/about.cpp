#include "scenes/about.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/Version.hpp>
#include <Eigen/Core>
#include <nlohmann/json.hpp>

#include "engine/fcl_version.h"
#include "parallel/tbb_version.h"
#include "qp/build_facts.h"
#include "scenes/drawing_png.h"
#include "scenes/fclib_file.h"
#include "scenes/live/live_server.h"

namespace islet {
namespace {

std::string Compiler() {
#if defined(__clang__)
  return fmt::format("clang {}.{}.{}", __clang_major__, __clang_minor__, __clang_patchlevel__);
#elif defined(__GNUC__)
  return fmt::format("gcc {}.{}.{}", __GNUC__, __GNUC_MINOR__, __GNUC_PATCHLEVEL__);
#else
  return "unknown";
#endif
}

}  // namespace

std::string Version() { return ISLET_VERSION; }

std::string About() {
  std::string text = fmt::format("islet {}\n", Version());
  const auto line = [&](const char* name, const std::string& value) {
    text += fmt::format("  {:<16}{}\n", name, value);
  };
  line("compiler", Compiler());
  line("vector kernels",
       fmt::format("{}; this machine runs {}", qp::ChosenKernels(), fmt::join(qp::RunnableKernels(), ", ")));
  line("Eigen", fmt::format("{}.{}.{}", EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION, EIGEN_MINOR_VERSION));
  line("oneTBB", parallel::TbbVersion());
  line("FCL", FclVersion());
  line("SuiteSparse AMD", qp::AmdVersion());
  line("HDF5", Hdf5Version());
  line("cairo", CairoVersion());
  line("cpp-httplib", HttplibVersion());
  line("fmt", fmt::format("{}.{}.{}", FMT_VERSION / 10000, FMT_VERSION / 100 % 100, FMT_VERSION % 100));
  line("CLI11", CLI11_VERSION);
  line("nlohmann-json",
       fmt::format("{}.{}.{}", NLOHMANN_JSON_VERSION_MAJOR, NLOHMANN_JSON_VERSION_MINOR, NLOHMANN_JSON_VERSION_PATCH));
  text.pop_back();
  return text;
}

}  // namespace islet
