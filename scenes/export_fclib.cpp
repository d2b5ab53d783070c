#include "scenes/export_fclib.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <utility>

namespace islet {
namespace {

namespace fs = std::filesystem;

std::string Padded(int number, int digits) {
  const std::string text = std::to_string(number);
  return std::string(std::max(0, digits - static_cast<int>(text.size())), '0') + text;
}

const char* NameOf(Stage stage) { return stage == Stage::kCollision ? "collision" : "static"; }

}  // namespace

FclibExample ToFclib(const qp::Problem& problem, const qp::Solution& solution) {
  const int nb = problem.num_bodies(), nc = problem.num_contacts();
  FclibExample out;
  FclibProblem& file = out.problem;
  file.global = true;
  file.load.resize(6 * nb);
  file.drift.resize(3 * nc);
  file.friction.resize(nc);
  out.solution.v = Eigen::Map<const Eigen::VectorXd>(solution.velocities.data(), 6 * nb);
  out.solution.u.resize(3 * nc);
  out.solution.r.resize(3 * nc);
  std::vector<Eigen::Triplet<double>> mass, coupling;
  for (int i = 0; i < nb; ++i) {
    const qp::BodyTerm& body = problem.bodies[i];
    for (int k = 0; k < 3; ++k) mass.emplace_back(6 * i + k, 6 * i + k, body.mass);
    for (int k = 0; k < 9; ++k)
      mass.emplace_back(6 * i + 3 + k / 3, 6 * i + 3 + k % 3,
                        0.5 * (body.inertia(k / 3, k % 3) + body.inertia(k % 3, k / 3)));
    file.load.segment<3>(6 * i) = body.mass * body.velocity.head<3>();
    file.load.segment<3>(6 * i + 3) = body.inertia * body.velocity.tail<3>();
  }
  for (int c = 0; c < nc; ++c) {
    const qp::ContactTerm& contact = problem.contacts[c];
    const auto couple = [&](int body, const qp::Jacobian& jacobian) {
      for (int k = 0; body >= 0 && k < 18; ++k)
        if (jacobian(k / 6, k % 6) != 0) coupling.emplace_back(6 * body + k % 6, 3 * c + k / 6, jacobian(k / 6, k % 6));
    };
    couple(contact.body_a, contact.jacobian_a);
    couple(contact.body_b, contact.jacobian_b);
    file.drift.segment<3>(3 * c) = contact.drift - contact.target * qp::Vector3::UnitX();
    file.friction[c] = contact.friction;
    out.solution.r.segment<3>(3 * c) = solution.impulses[c];
  }
  file.mass.resize(6 * nb, 6 * nb);
  file.mass.setFromTriplets(mass.begin(), mass.end());
  file.coupling.resize(6 * nb, 3 * nc);
  file.coupling.setFromTriplets(coupling.begin(), coupling.end());
  out.solution.u = file.coupling.transpose() * out.solution.v + file.drift;
  return out;
}

FclibExport::FclibExport(std::string folder, std::vector<int> frames, std::string label)
    : folder_(std::move(folder)), frames_(std::move(frames)), label_(std::move(label)) {
  std::sort(frames_.begin(), frames_.end());
  std::error_code error;
  fs::create_directory(folder_, error);
  if (error) throw std::runtime_error("cannot make the folder " + folder_ + ": " + error.message());
}

std::string FclibExport::Told() const {
  std::size_t left = 0;
  std::error_code error;
  for (fs::directory_iterator file(folder_, error), end; !error && file != end; file.increment(error))
    left += file->path().extension() == ".hdf5" && names_.count(file->path().filename().string()) == 0;
  const std::string beside = left > 0 ? ", beside " + std::to_string(left) + " files that were there before" : "";
  return "  exported      " + std::to_string(files()) + " problems to " + folder_ + beside + "\n";
}

void FclibExport::CheckFolder(const std::string& option, const std::string& folder) {
  std::error_code error;
  std::string reason;
  if (fs::exists(folder, error)) {
    if (!fs::is_directory(folder, error)) {
      reason = "it is not a folder";
    } else if (::access(folder.c_str(), W_OK | X_OK) != 0) {
      reason = std::strerror(errno);
    }
  } else if (fs::create_directory(folder, error)) {
    fs::remove(folder, error);
  } else {
    reason = error.message();
  }
  if (!reason.empty()) throw std::invalid_argument(option + ": cannot write to " + folder + ": " + reason);
}

bool FclibExport::Wants(int frame) const {
  return frames_.empty() || std::binary_search(frames_.begin(), frames_.end(), frame);
}

void FclibExport::Write(int frame, const ProblemRecord& record) {
  int round = record.round;
  std::string name;
  do {  // a crowd's island and a small group may have the same number
    name = "frame_" + Padded(frame, 6) + "_round_" + std::to_string(round++) + "_island_" + Padded(record.island, 5) +
           "_" + NameOf(record.stage) + ".hdf5";
  } while (!names_.insert(name).second);
  const std::string place = "frame " + std::to_string(frame) + ", round " + std::to_string(round - 1) + ", island " +
                            std::to_string(record.island) + ", stage " + NameOf(record.stage);
  const FclibExample example = ToFclib(record.problem, record.solution);
  WriteFclib((fs::path(folder_) / name).string(), example.problem,
             record.status == QpStatus::kFailed ? nullptr : &example.solution, "islet " + label_ + ", " + place,
             label_ + "; " + place + "; status " + ToString(record.status) +
                 "; units m, kg, s; impulses in N s; /solution is islet's answer");
}

}  // namespace islet
