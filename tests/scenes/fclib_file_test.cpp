#include "scenes/fclib_file.h"

#include <gtest/gtest.h>
#include <hdf5.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <vector>

namespace islet::testing {
namespace {

namespace fs = std::filesystem;

// A folder of this test process alone, removed with it.
const fs::path& Folder() {
  struct Owner {
    fs::path path = fs::temp_directory_path() / ("islet_fclib_file_test_" + std::to_string(::getpid()));
    Owner() { fs::create_directories(path); }
    ~Owner() { fs::remove_all(path); }
  };
  static const Owner owner;
  return owner.path;
}

// Writes HDF5 files as others would, part by part, without the code under test.
class Author {
 public:
  explicit Author(const std::string& name) : path_((Folder() / name).string()) {
    file_ = H5Fcreate(path_.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
  }
  ~Author() { Close(); }
  const std::string& Close() {
    if (file_ >= 0) H5Fclose(file_);
    file_ = -1;
    return path_;
  }
  void Integers(const std::string& place, const std::vector<int>& values) {
    Set(place, H5T_NATIVE_INT, values.size(), values.data());
  }
  void Reals(const std::string& place, const std::vector<double>& values) {
    Set(place, H5T_NATIVE_DOUBLE, values.size(), values.data());
  }
  void Matrix(const std::string& place, int m, int n, int nz, const std::vector<int>& p, const std::vector<int>& i,
              const std::vector<double>& x) {
    Integers(place + "/nzmax", {static_cast<int>(x.size())});
    Integers(place + "/m", {m});
    Integers(place + "/n", {n});
    Integers(place + "/nz", {nz});
    Integers(place + "/p", p);
    Integers(place + "/i", i);
    Reals(place + "/x", x);
  }
  // That claims to hold so many numbers, and holds none of them.
  void Claim(const std::string& place, hsize_t count) {
    const hid_t space = H5Screate_simple(1, &count, nullptr);
    const hid_t set = H5Dcreate2(file_, place.c_str(), H5T_NATIVE_DOUBLE, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    H5Dclose(set);
    H5Sclose(space);
  }
  // Whose numbers are those of another file.
  void BorrowReals(const std::string& place, const std::string& from, hsize_t count) {
    const hid_t space = H5Screate_simple(1, &count, nullptr), properties = H5Pcreate(H5P_DATASET_CREATE);
    H5Pset_external(properties, from.c_str(), 0, count * sizeof(double));
    const hid_t set = H5Dcreate2(file_, place.c_str(), H5T_NATIVE_DOUBLE, space, H5P_DEFAULT, properties, H5P_DEFAULT);
    H5Dclose(set);
    H5Pclose(properties);
    H5Sclose(space);
  }
  void Remove(const std::string& place) { H5Ldelete(file_, place.c_str(), H5P_DEFAULT); }

 private:
  void Set(const std::string& place, hid_t type, hsize_t count, const void* values) {
    const hid_t groups = H5Pcreate(H5P_LINK_CREATE), space = H5Screate_simple(1, &count, nullptr);
    H5Pset_create_intermediate_group(groups, 1);
    const hid_t set = H5Dcreate2(file_, place.c_str(), type, space, groups, H5P_DEFAULT, H5P_DEFAULT);
    ASSERT_GE(set, 0) << place;
    if (count > 0) H5Dwrite(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values);
    H5Dclose(set);
    H5Sclose(space);
    H5Pclose(groups);
  }
  std::string path_;
  hid_t file_;
};

// One contact: W = diag(1, 2, 3) with W_01 = W_10 = 0.5.
void WriteLocal(Author* author) {
  author->Integers("/fclib_local/spacedim", {3});
  author->Matrix("/fclib_local/W", 3, 3, -1, {0, 2, 4, 5}, {0, 1, 0, 1, 2}, {1, 0.5, 0.5, 2, 3});
  author->Reals("/fclib_local/vectors/q", {-1, 0.25, 0});
  author->Reals("/fclib_local/vectors/mu", {0.3});
}

// M 2 x 2, H 2 x 3 with H_0 = (1 0 4), H_1 = (0 2 0).
void WriteGlobal(Author* author) {
  author->Integers("/fclib_global/spacedim", {3});
  author->Matrix("/fclib_global/M", 2, 2, -1, {0, 1, 2}, {0, 1}, {5, 6});
  author->Matrix("/fclib_global/H", 2, 3, -1, {0, 1, 2, 3}, {0, 1, 0}, {1, 2, 4});
  author->Reals("/fclib_global/vectors/f", {1, 2});
  author->Reals("/fclib_global/vectors/w", {-1, 0, 0.5});
  author->Reals("/fclib_global/vectors/mu", {0.7});
}

TEST(FclibFile, ReadsALocalProblem) {
  Author author("local.hdf5");
  WriteLocal(&author);
  const FclibProblem problem = ReadFclib(author.Close());
  EXPECT_FALSE(problem.global);
  EXPECT_EQ(Eigen::MatrixXd(problem.delassus), (Eigen::Matrix3d{{1, 0.5, 0}, {0.5, 2, 0}, {0, 0, 3}}));
  EXPECT_EQ(problem.q, Eigen::Vector3d(-1, 0.25, 0));
  EXPECT_EQ(problem.num_contacts(), 1);
  EXPECT_EQ(problem.friction[0], 0.3);
}

const Eigen::MatrixXd kCoupling{{1, 0, 4}, {0, 2, 0}};

TEST(FclibFile, ReadsAGlobalProblem) {
  Author author("global.hdf5");
  WriteGlobal(&author);
  const FclibProblem problem = ReadFclib(author.Close());
  EXPECT_TRUE(problem.global);
  EXPECT_EQ(Eigen::MatrixXd(problem.mass), (Eigen::Matrix2d{{5, 0}, {0, 6}}));
  EXPECT_EQ(Eigen::MatrixXd(problem.coupling), kCoupling);
  EXPECT_EQ(problem.load, Eigen::Vector2d(1, 2));
  EXPECT_EQ(problem.drift, Eigen::Vector3d(-1, 0, 0.5));
}

// The same H as triplets, rows in p as fclib.h says and rows in i as it is written; with room to spare, and with an entry in
// two parts; and as compressed rows.
TEST(FclibFile, ReadsEveryStorage) {
  const auto read = [](int nz, const std::vector<int>& p, const std::vector<int>& i, const std::vector<double>& x) {
    Author author("storage.hdf5");
    WriteGlobal(&author);
    author.Remove("/fclib_global/H");
    author.Matrix("/fclib_global/H", 2, 3, nz, p, i, x);
    return Eigen::MatrixXd(ReadFclib(author.Close()).coupling);
  };
  EXPECT_EQ(read(3, {0, 1, 0}, {0, 1, 2}, {1, 2, 4}), kCoupling);                    // p = row
  EXPECT_EQ(read(3, {0, 1, 2}, {0, 1, 0}, {1, 2, 4}), kCoupling);                    // i = row
  EXPECT_EQ(read(3, {0, 1, 2, 9, 9}, {0, 1, 0, 9, 9}, {1, 2, 4, 7, 7}), kCoupling);  // nzmax = 5
  EXPECT_EQ(read(4, {0, 1, 2, 2}, {0, 1, 0, 0}, {1, 2, 3, 1}), kCoupling);           // sums what comes twice
  EXPECT_EQ(read(-2, {0, 2, 3}, {0, 2, 1}, {1, 4, 2}), kCoupling);
}

std::string Reason(const std::string& path) {
  try {
    ReadFclib(path);
  } catch (const FclibError& error) {
    EXPECT_EQ(std::string(error.what()).rfind(path, 0), 0u) << "no file name in " << error.what();
    return std::string(error.what()).substr(path.size());
  }
  return "read without complaint";
}

TEST(FclibFile, TellsWhatIsNoProblemAtAll) {
  EXPECT_EQ(Reason((Folder() / "missing.hdf5").string()), ": cannot be read: No such file or directory");
  EXPECT_EQ(Reason(Folder().string()), ": it is a directory");
  const std::string text = (Folder() / "text.hdf5").string(), empty = (Folder() / "empty.hdf5").string();
  std::ofstream(text) << "no HDF5";
  std::ofstream(empty).flush();
  EXPECT_EQ(Reason(text), ": not an HDF5 file");
  EXPECT_EQ(Reason(empty), ": not an HDF5 file");
  Author author("cut.hdf5");
  WriteLocal(&author);
  const std::string cut = author.Close();
  fs::resize_file(cut, fs::file_size(cut) / 2);
  EXPECT_EQ(Reason(cut), ": not a readable HDF5 file");
}

// Each kind of damage, and the data set that the message must name.
TEST(FclibFile, NamesTheDataSetThatIsWrong) {
  const auto damaged = [](bool global, const std::function<void(Author*)>& damage) {
    Author author("damaged.hdf5");
    global ? WriteGlobal(&author) : WriteLocal(&author);
    damage(&author);
    return Reason(author.Close());
  };
  const auto replaced = [&](const std::string& place, const std::vector<double>& values) {
    return damaged(place.rfind("/fclib_global", 0) == 0, [&](Author* a) { a->Remove(place), a->Reals(place, values); });
  };
  const auto replaced_integers = [&](const std::string& place, const std::vector<int>& values) {
    return damaged(place.rfind("/fclib_global", 0) == 0,
                   [&](Author* a) { a->Remove(place), a->Integers(place, values); });
  };
  using A = Author*;
  EXPECT_EQ(damaged(false, [](A a) { a->Remove("/fclib_local"); }), ": /: holds neither fclib_local nor fclib_global");
  EXPECT_EQ(damaged(false, [](A a) { WriteGlobal(a); }), ": /: holds both fclib_local and fclib_global");
  EXPECT_EQ(damaged(false, [](A a) { a->Integers("/fclib_global_rolling/spacedim", {5}); }),
            ": /fclib_global_rolling: rolling friction is not solved here");
  EXPECT_EQ(damaged(false, [](A a) { a->Reals("/fclib_local/V/x", {1}); }),
            ": /fclib_local/V: equality constraints are not solved here");
  EXPECT_EQ(damaged(true, [](A a) { a->Reals("/fclib_global/G/x", {1}); }),
            ": /fclib_global/G: equality constraints are not solved here");
  for (const std::string gone :
       {"spacedim", "W", "W/m", "W/p", "W/i", "W/x", "W/nz", "vectors", "vectors/q", "vectors/mu"}) {
    const std::string reason = damaged(false, [&](A a) { a->Remove("/fclib_local/" + gone); });
    EXPECT_NE(reason.find(": /fclib_local/" + gone), std::string::npos) << reason;
    EXPECT_NE(reason.find("is missing"), std::string::npos) << reason;
  }
  EXPECT_EQ(replaced_integers("/fclib_local/spacedim", {2}),
            ": /fclib_local/spacedim: is 2; only problems in 3 dimensions are solved");
  EXPECT_EQ(replaced("/fclib_local/spacedim", {3}), ": /fclib_local/spacedim: does not hold integers");
  EXPECT_EQ(replaced_integers("/fclib_local/vectors/q", {1, 2, 3}),
            ": /fclib_local/vectors/q: does not hold real numbers");
  EXPECT_EQ(replaced("/fclib_local/vectors/q", {-1, NAN, 0}), ": /fclib_local/vectors/q: number 1 is nan");
  EXPECT_EQ(replaced("/fclib_local/vectors/q", {-1, 0}), ": /fclib_local/vectors/q: has 2 numbers, should have 3");
  EXPECT_EQ(replaced("/fclib_local/vectors/mu", {-0.5}), ": /fclib_local/vectors/mu: number 0 is -0.5");
  EXPECT_EQ(replaced("/fclib_local/vectors/mu", {0.5, 0.5}), ": /fclib_local/vectors/mu: has 2 numbers, should have 1");
  EXPECT_EQ(replaced("/fclib_local/W/x", {1, 0.5, 0.5, INFINITY, 3}), ": /fclib_local/W/x: number 3 is inf");
  EXPECT_EQ(replaced("/fclib_local/W/x", {1, 0.5}), ": /fclib_local/W/x: has 2 numbers, should have 5");
  EXPECT_EQ(replaced_integers("/fclib_local/W/i", {0, 1, 0, 1, 3}), ": /fclib_local/W/i: index 3 is not in [0, 3)");
  EXPECT_EQ(replaced_integers("/fclib_local/W/p", {0, 2, 1, 5}), ": /fclib_local/W/p: does not ascend from 0");
  EXPECT_EQ(replaced_integers("/fclib_local/W/m", {-3}), ": /fclib_local/W/m: is -3");
  EXPECT_EQ(replaced_integers("/fclib_local/W/m", {4}), ": /fclib_local/W: is 4 x 3, should be 4 x 4");
  EXPECT_EQ(replaced_integers("/fclib_local/W/nz", {-3}), ": /fclib_local/W/nz: is -3");
  EXPECT_EQ(replaced_integers("/fclib_local/W/nz", {}), ": /fclib_local/W/nz: has 0 numbers, should have 1");
  EXPECT_EQ(replaced_integers("/fclib_local/W/nz", {4}), ": /fclib_local/W/i and p: index 4 is not in [0, 3)");
  EXPECT_EQ(replaced("/fclib_global/vectors/f", {1, 2, 3}), ": /fclib_global/vectors/f: has 3 numbers, should have 2");
  EXPECT_EQ(replaced("/fclib_global/vectors/w", {1}), ": /fclib_global/vectors/w: has 1 numbers, should have 3");
  EXPECT_EQ(replaced_integers("/fclib_global/M/n", {1}), ": /fclib_global/M: is 2 x 1, should be 2 x 2");
  EXPECT_EQ(damaged(true,
                    [](A a) {
                      a->Remove("/fclib_global/H");
                      a->Matrix("/fclib_global/H", 2, 2, -1, {0, 1, 2}, {0, 1}, {1, 2});
                      a->Remove("/fclib_global/vectors/w");
                      a->Reals("/fclib_global/vectors/w", {1, 2});
                    }),
            ": /fclib_global/H: 2 rows of contacts are not a multiple of 3");
}

// Sizes that the file cannot hold are refused before there is memory for them: these would take gigabytes.
TEST(FclibFile, RefusesWhatTheFileCannotHold) {
  const auto damaged = [](const std::function<void(Author*)>& damage) {
    Author author("claims.hdf5");
    WriteLocal(&author);
    damage(&author);
    return Reason(author.Close());
  };
  const auto begins = [](const std::string& text, const std::string& beginning) {
    return text.rfind(beginning, 0) == 0 ? ::testing::AssertionSuccess() : ::testing::AssertionFailure() << text;
  };
  using A = Author*;
  for (const std::string place : {"W/x", "vectors/q", "vectors/mu"})
    EXPECT_TRUE(begins(damaged([&](A a) {
                         a->Remove("/fclib_local/" + place);
                         a->Claim("/fclib_local/" + place, place == "W/x" ? 200'000'000 : place == "vectors/q" ? 3 : 1);
                       }),
                       ": /fclib_local/" + place + ": claims "));
  for (const std::string place : {"W/m", "W/n"})
    EXPECT_TRUE(begins(damaged([&](A a) {
                         a->Remove("/fclib_local/" + place);
                         a->Integers("/fclib_local/" + place, {30'000'000});
                       }),
                       ": /fclib_local/" + place + ": is 30000000, which a file of "));
  EXPECT_EQ(damaged([&](A a) {
              a->Remove("/fclib_local/vectors/q");
              a->BorrowReals("/fclib_local/vectors/q", "/dev/zero", 3);
            }),
            ": /fclib_local/vectors/q: has its numbers in another file");
}

TEST(FclibFile, WritesWhatItReads) {
  Author author("original.hdf5");
  WriteGlobal(&author);
  const FclibProblem problem = ReadFclib(author.Close());
  const FclibSolution solution{Eigen::Vector2d(0.5, 1.5), Eigen::Vector3d(1, 2, 3), Eigen::Vector3d(4, 5, 6)};
  const std::string path = (Folder() / "copy.hdf5").string();
  WriteFclib(path, problem, &solution, "title", "description");
  const FclibProblem copy = ReadFclib(path);
  EXPECT_TRUE(copy.global);
  EXPECT_EQ(Eigen::MatrixXd(copy.mass), Eigen::MatrixXd(problem.mass));
  EXPECT_EQ(Eigen::MatrixXd(copy.coupling), Eigen::MatrixXd(problem.coupling));
  EXPECT_EQ(copy.load, problem.load);
  EXPECT_EQ(copy.drift, problem.drift);
  EXPECT_EQ(copy.friction, problem.friction);
  const hid_t file = H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
  const hid_t set = H5Dopen2(file, "/solution/r", H5P_DEFAULT);
  Eigen::Vector3d r;
  EXPECT_GE(H5Dread(set, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, r.data()), 0);
  EXPECT_EQ(r, solution.r);
  H5Dclose(set);
  H5Fclose(file);

  EXPECT_THROW(WriteFclib((Folder() / "nowhere" / "x.hdf5").string(), problem, nullptr, "", ""), std::runtime_error);
  int files = 0;
  for (const auto& entry : fs::directory_iterator(Folder()))
    files += entry.path().string().find(".part") != std::string::npos;
  EXPECT_EQ(files, 0);
}

}  // namespace
}  // namespace islet::testing
