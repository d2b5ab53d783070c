#include "scenes/fclib_file.h"

#include <hdf5.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <vector>

#include "engine/number_text.h"
#include "scenes/output_file.h"

namespace islet {
namespace {

constexpr hsize_t kMostNumbers = hsize_t{1} << 28;  // in one data set; more is taken for a broken file
constexpr int kMostRows = 1 << 25;                  // of a matrix
constexpr hsize_t kMostPacked = 1032;               // bytes that deflate makes of one

// Closes what it holds; a negative number is none.
class Handle {
 public:
  Handle(hid_t id, herr_t (*close)(hid_t)) : id_(id), close_(close) {}
  ~Handle() {
    if (id_ >= 0) close_(id_);
  }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  operator hid_t() const { return id_; }
  bool valid() const { return id_ >= 0; }

 private:
  hid_t id_;
  herr_t (*close_)(hid_t);
};

// No clean-up of its own at the end: a file that a full disk kept it from closing would end the process there. What goes wrong is told by
// our own messages.
void PrepareLibrary() {
  [[maybe_unused]] static const herr_t once = H5dont_atexit();
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
}

class Reader {
 public:
  explicit Reader(const std::string& path) : path_(path), file_(Open(path), H5Fclose) {
    if (!file_.valid()) throw FclibError(path + ": not a readable HDF5 file");
    std::error_code error;
    bytes_ = std::filesystem::file_size(path, error);
    if (error) throw FclibError(path + ": " + error.message());
  }

  [[noreturn]] void Fail(const std::string& place, const std::string& what) const {
    throw FclibError(path_ + ": " + place + ": " + what);
  }

  // Asks link by link: HDF5 takes a missing group on the way for an error.
  bool Has(const std::string& place) const {
    for (size_t end = place.find('/', 1);; end = place.find('/', end + 1)) {
      if (H5Lexists(file_, place.substr(0, end).c_str(), H5P_DEFAULT) <= 0) return false;
      if (end == std::string::npos) return H5Oexists_by_name(file_, place.c_str(), H5P_DEFAULT) > 0;
    }
  }

  // Rows or columns: each has numbers of its own in the file, so they are no more than its bytes.
  int Lines(const std::string& place) const {
    const int lines = Integer(place);
    if (lines < 0 || lines > kMostRows) Fail(place, "is " + std::to_string(lines));
    if (static_cast<hsize_t>(lines) > bytes_)
      Fail(place, "is " + std::to_string(lines) + ", which a file of " + std::to_string(bytes_) + " bytes cannot hold");
    return lines;
  }

  int Integer(const std::string& place) const { return Integers(place, 1)[0]; }

  // The first `count` numbers of a data set that may hold more.
  std::vector<int> Integers(const std::string& place, hsize_t count) const {
    std::vector<int> values;
    Read(place, count, H5T_INTEGER, "integers", H5T_NATIVE_INT, &values);
    return values;
  }
  std::vector<double> Reals(const std::string& place, hsize_t count) const {
    std::vector<double> values;
    Read(place, count, H5T_FLOAT, "real numbers", H5T_NATIVE_DOUBLE, &values);
    for (size_t i = 0; i < values.size(); ++i)
      if (!std::isfinite(values[i])) Fail(place, "number " + std::to_string(i) + " is " + Text(values[i]));
    return values;
  }

  Eigen::VectorXd Vector(const std::string& place, int size) const {
    const hsize_t count = Count(place);
    if (count != static_cast<hsize_t>(size))
      Fail(place, "has " + std::to_string(count) + " numbers, should have " + std::to_string(size));
    const std::vector<double> values = Reals(place, count);
    return Eigen::Map<const Eigen::VectorXd>(values.data(), size);
  }

  SparseMatrix Matrix(const std::string& place) const;

 private:
  static hid_t Open(const std::string& path) {
    PrepareLibrary();
    std::error_code error;
    if (std::filesystem::is_directory(path, error)) throw FclibError(path + ": it is a directory");
    errno = 0;
    if (!std::ifstream(path, std::ios::binary))
      throw FclibError(path + ": cannot be read: " + std::strerror(errno ? errno : EIO));
    if (H5Fis_hdf5(path.c_str()) <= 0) throw FclibError(path + ": not an HDF5 file");
    return H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
  }

  hsize_t Count(const std::string& place) const {
    if (!Has(place)) Fail(place, "is missing");
    const Handle set(H5Dopen2(file_, place.c_str(), H5P_DEFAULT), H5Dclose);
    if (!set.valid()) Fail(place, "is not a data set");
    const Handle space(H5Dget_space(set), H5Sclose);
    const hssize_t count = H5Sget_simple_extent_npoints(space);
    if (count < 0 || static_cast<hsize_t>(count) > kMostNumbers) Fail(place, "has an impossible size");
    return static_cast<hsize_t>(count);
  }

  // Before memory is allocated for it: what a data set claims to hold must be there, in this file.
  void CheckStorage(const std::string& place, hid_t set, hsize_t claimed) const {
    const Handle properties(H5Dget_create_plist(set), H5Pclose);
    if (H5Pget_external_count(properties) > 0) Fail(place, "has its numbers in another file");
    const hsize_t stored = H5Dget_storage_size(set);
    if (stored > bytes_ || claimed > stored * kMostPacked)
      Fail(place, "claims " + std::to_string(claimed) + " bytes, of which the file holds " +
                      std::to_string(std::min(stored, bytes_)));
  }

  template <typename T>
  void Read(const std::string& place, hsize_t count, H5T_class_t wanted, const char* name, hid_t memory_type,
            std::vector<T>* values) const {
    const hsize_t held = Count(place);
    if (held < count) Fail(place, "has " + std::to_string(held) + " numbers, should have " + std::to_string(count));
    const Handle set(H5Dopen2(file_, place.c_str(), H5P_DEFAULT), H5Dclose);
    const Handle type(H5Dget_type(set), H5Tclose);
    if (H5Tget_class(type) != wanted) Fail(place, std::string("does not hold ") + name);
    CheckStorage(place, set, held * H5Tget_size(type));
    values->resize(held);
    if (held > 0 && H5Dread(set, memory_type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values->data()) < 0)
      Fail(place, "cannot be read");
    values->resize(count);
  }

  void CheckIndices(const std::string& place, const std::vector<int>& indices, int limit) const {
    for (const int index : indices)
      if (index < 0 || index >= limit)
        Fail(place, "index " + std::to_string(index) + " is not in [0, " + std::to_string(limit) + ")");
  }

  std::string path_;
  Handle file_;
  hsize_t bytes_ = 0;  // of the file
};

bool AllBelow(const std::vector<int>& indices, int limit) {
  return std::all_of(indices.begin(), indices.end(), [limit](int index) { return index >= 0 && index < limit; });
}

SparseMatrix Reader::Matrix(const std::string& place) const {
  if (!Has(place)) Fail(place, "is missing");
  const int rows = Lines(place + "/m"), columns = Lines(place + "/n"), nz = Integer(place + "/nz");
  if (nz < -2) Fail(place + "/nz", "is " + std::to_string(nz));
  std::vector<int> row, column;
  std::vector<double> value;
  if (nz >= 0) {
    row = Integers(place + "/i", nz), column = Integers(place + "/p", nz);
    value = Reals(place + "/x", nz);
    if (!AllBelow(row, rows) || !AllBelow(column, columns)) std::swap(row, column);
    CheckIndices(place + "/i and p", row, rows);
    CheckIndices(place + "/i and p", column, columns);
  } else {
    const int lines = nz == -1 ? columns : rows;
    const std::vector<int> start = Integers(place + "/p", hsize_t(lines) + 1);
    if (start[0] != 0 || !std::is_sorted(start.begin(), start.end())) Fail(place + "/p", "does not ascend from 0");
    std::vector<int> across = Integers(place + "/i", start.back()), along;
    value = Reals(place + "/x", start.back());
    CheckIndices(place + "/i", across, nz == -1 ? rows : columns);
    for (int k = 0; k < lines; ++k) along.insert(along.end(), start[k + 1] - start[k], k);
    row = nz == -1 ? across : along, column = nz == -1 ? along : across;
  }
  std::vector<Eigen::Triplet<double>> entries;
  for (size_t k = 0; k < value.size(); ++k) entries.emplace_back(row[k], column[k], value[k]);
  SparseMatrix matrix(rows, columns);
  matrix.setFromTriplets(entries.begin(), entries.end());
  return matrix;
}

void RequireSize(const Reader& reader, const std::string& place, const SparseMatrix& matrix, Eigen::Index rows,
                 Eigen::Index columns) {
  if (matrix.rows() == rows && matrix.cols() == columns) return;
  reader.Fail(place, "is " + std::to_string(matrix.rows()) + " x " + std::to_string(matrix.cols()) + ", should be " +
                         std::to_string(rows) + " x " + std::to_string(columns));
}

std::string FindRoot(const Reader& reader) {
  if (reader.Has("/fclib_global_rolling")) reader.Fail("/fclib_global_rolling", "rolling friction is not solved here");
  const bool local = reader.Has("/fclib_local"), global = reader.Has("/fclib_global");
  if (!local && !global) reader.Fail("/", "holds neither fclib_local nor fclib_global");
  if (local && global) reader.Fail("/", "holds both fclib_local and fclib_global");
  return local ? "/fclib_local" : "/fclib_global";
}

// Writing.

void RequireWritten(bool good) {
  if (!good) throw std::runtime_error("cannot be written: " + std::string(std::strerror(errno ? errno : EIO)));
}

void WriteSet(hid_t parent, const char* name, hid_t type, hsize_t count, const void* values) {
  const Handle space(H5Screate_simple(1, &count, nullptr), H5Sclose);
  const Handle set(H5Dcreate2(parent, name, type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Dclose);
  RequireWritten(set.valid() && (count == 0 || H5Dwrite(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values) >= 0));
}
void WriteVector(hid_t parent, const char* name, const Eigen::VectorXd& v) {
  WriteSet(parent, name, H5T_NATIVE_DOUBLE, static_cast<hsize_t>(v.size()), v.data());
}
void WriteInteger(hid_t parent, const char* name, int value) { WriteSet(parent, name, H5T_NATIVE_INT, 1, &value); }

void WriteText(hid_t parent, const char* name, const std::string& text) {
  const Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
  H5Tset_size(type, text.size() + 1);
  const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
  const Handle set(H5Dcreate2(parent, name, type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Dclose);
  RequireWritten(set.valid() && H5Dwrite(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, text.c_str()) >= 0);
}

hid_t MakeGroup(hid_t parent, const char* name) {
  const hid_t group = H5Gcreate2(parent, name, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
  RequireWritten(group >= 0);
  return group;
}

void WriteMatrix(hid_t parent, const char* name, SparseMatrix matrix) {
  matrix.makeCompressed();
  const Handle group(MakeGroup(parent, name), H5Gclose);
  const int nonzeros = static_cast<int>(matrix.nonZeros());
  WriteInteger(group, "nzmax", nonzeros);
  WriteInteger(group, "m", static_cast<int>(matrix.rows()));
  WriteInteger(group, "n", static_cast<int>(matrix.cols()));
  WriteInteger(group, "nz", -1);
  WriteSet(group, "p", H5T_NATIVE_INT, static_cast<hsize_t>(matrix.cols()) + 1, matrix.outerIndexPtr());
  WriteSet(group, "i", H5T_NATIVE_INT, nonzeros, matrix.innerIndexPtr());
  WriteSet(group, "x", H5T_NATIVE_DOUBLE, nonzeros, matrix.valuePtr());
}

void WriteAll(hid_t file, const FclibProblem& problem, const FclibSolution* solution, const std::string& title,
              const std::string& description) {
  const Handle root(MakeGroup(file, problem.global ? "fclib_global" : "fclib_local"), H5Gclose);
  WriteInteger(root, "spacedim", 3);
  const Handle vectors(MakeGroup(root, "vectors"), H5Gclose);
  if (problem.global) {
    WriteMatrix(root, "M", problem.mass);
    WriteMatrix(root, "H", problem.coupling);
    WriteVector(vectors, "f", problem.load);
    WriteVector(vectors, "w", problem.drift);
  } else {
    WriteMatrix(root, "W", problem.delassus);
    WriteVector(vectors, "q", problem.q);
  }
  WriteVector(vectors, "mu", problem.friction);
  const Handle info(MakeGroup(root, "info"), H5Gclose);
  WriteText(info, "title", title);
  WriteText(info, "description", description);
  WriteText(info, "math_info", "");
  if (!solution) return;
  const Handle answer(MakeGroup(file, "solution"), H5Gclose);
  if (problem.global) WriteVector(answer, "v", solution->v);
  WriteVector(answer, "u", solution->u);
  WriteVector(answer, "r", solution->r);
}

}  // namespace

std::string Hdf5Version() {
  unsigned major = 0, minor = 0, release = 0;
  H5get_libversion(&major, &minor, &release);
  return std::to_string(major) + "." + std::to_string(minor) + "." + std::to_string(release);
}

FclibProblem ReadFclib(const std::string& path) {
  const Reader reader(path);
  const std::string root = FindRoot(reader), vectors = root + "/vectors";
  FclibProblem problem;
  problem.global = root == "/fclib_global";
  const int dimensions = reader.Integer(root + "/spacedim");
  if (dimensions != 3)
    reader.Fail(root + "/spacedim", "is " + std::to_string(dimensions) + "; only problems in 3 dimensions are solved");
  for (const char* constraints : {"/V", "/R", "/G"})
    if (reader.Has(root + constraints)) reader.Fail(root + constraints, "equality constraints are not solved here");
  const std::string shaping = root + (problem.global ? "/H" : "/W");
  Eigen::Index size;
  if (problem.global) {
    problem.mass = reader.Matrix(root + "/M");
    problem.coupling = reader.Matrix(shaping);
    size = problem.coupling.cols();
    RequireSize(reader, root + "/M", problem.mass, problem.mass.rows(), problem.mass.rows());
    RequireSize(reader, shaping, problem.coupling, problem.mass.rows(), size);
    problem.load = reader.Vector(vectors + "/f", static_cast<int>(problem.mass.rows()));
    problem.drift = reader.Vector(vectors + "/w", static_cast<int>(size));
  } else {
    problem.delassus = reader.Matrix(shaping);
    size = problem.delassus.rows();
    RequireSize(reader, shaping, problem.delassus, size, size);
    problem.q = reader.Vector(vectors + "/q", static_cast<int>(size));
  }
  if (size % 3 != 0) reader.Fail(shaping, std::to_string(size) + " rows of contacts are not a multiple of 3");
  problem.friction = reader.Vector(vectors + "/mu", static_cast<int>(size / 3));
  for (int c = 0; c < problem.num_contacts(); ++c)
    if (problem.friction[c] < 0)
      reader.Fail(vectors + "/mu", "number " + std::to_string(c) + " is " + Text(problem.friction[c]));
  return problem;
}

void WriteFclib(const std::string& path, const FclibProblem& problem, const FclibSolution* solution,
                const std::string& title, const std::string& description) {
  PrepareLibrary();
  TemporaryFile file(path);
  errno = 0;
  try {
    const hid_t id = H5Fcreate(file.place().c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
    RequireWritten(id >= 0);
    try {
      WriteAll(id, problem, solution, title, description);
    } catch (...) {
      H5Fclose(id);
      throw;
    }
    RequireWritten(H5Fclose(id) >= 0);  // what was held back in memory is written here
  } catch (const std::exception& error) {
    throw std::runtime_error(path + ": " + error.what());
  }
  file.Commit();
}

}  // namespace islet
