#include "qp/interior_point/row_kernels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <tuple>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/LU>

#include "qp/interior_point/row_batches.h"
#include "tests/support/cone_algebra.h"
#include "tests/support/random_problems.h"

namespace islet::testing {
namespace {

using qp::Cone;
using qp::Lanes;
using qp::Matrix3;
using qp::Vector6;
using Rows = std::array<double, qp::kMaxRows>;

constexpr int kContacts = 13, kBodies = 4;  // of either field: the last batch has empty lanes

// Rays and other cones in two fields, some contacts soft, all data random; every kernel is compared with cone.h, contact by
// contact, or with the equation that it is to satisfy.
class RowKernelsOf : public ::testing::TestWithParam<std::tuple<std::string, Cone>> {
 protected:
  void SetUp() override {
    kernels_ = qp::FindRowKernels(std::get<0>(GetParam()).c_str());
    if (kernels_ == nullptr) GTEST_SKIP() << "not on this machine";
    problem_.bodies.resize(kBodies);
    for (int c = 0; c < kContacts; ++c) {
      qp::ContactTerm contact;
      contact.body_a = random_.Integer(-1, kBodies - 2);
      contact.body_b = kBodies - 1;
      for (int i = 0; i < 18; ++i) {
        if (contact.body_a >= 0) contact.jacobian_a(i) = random_.Uniform(-1, 1);
        contact.jacobian_b(i) = random_.Uniform(-1, 1);
      }
      problem_.contacts.push_back(contact);
    }
    batches_.Clear();
    for (int field = 0; field < 2; ++field) {
      for (int c = 0; c < kContacts; ++c) {
        Entry e;
        e.cone = qp::ChooseCone(field == 0 ? 0 : random_.Uniform(0.1, 1.5), std::get<1>(GetParam()));
        e.contact = c, e.field = field, e.offset = random_.Vector(1);
        e.compliance = c % 3 == 0 ? random_.Uniform(0, 2) : 0;
        e.place = batches_.Add({problem_.contacts[c], c, e.cone, e.offset, e.compliance, field});
        while (batches_.batches()[e.batch].first != e.place.first) ++e.batch;
        entries_.push_back(e);
      }
    }
    batches_.Finish(problem_, 2);
    for (auto* v : {&s_, &z_}) batches_.FillWithUnits(v);
    const size_t rows = batches_.num_rows(), batches = batches_.size();
    for (auto* v : {&point_, &inverse_, &lambda_, &primal_, &target_, &ds_, &dz_, &plain_, &other_})
      v->assign(rows, Lanes{});
    for (auto* v : {&softening_, &d_}) v->assign(9 * batches, Lanes{});
    for (auto* v : {&constants_, &forces_}) v->assign(3 * batches, Lanes{});
    for (auto* v : {&y_, &dy_, &correction_}) {
      for (int i = 0; i < 12 * kBodies; ++i) v->push_back(random_.Uniform(-1, 1));
      v->resize(v->size() + 2);
    }
    for (const Entry& e : entries_) Put(&s_, e, Inside(e.cone)), Put(&z_, e, Inside(e.cone));
  }

  struct Entry {
    qp::ContactCone cone;
    int contact, field;
    Vector3 offset;
    double compliance;
    qp::RowPlace place;
    size_t batch = 0;
    Vector3 Yield(const Vector3& j) const { return compliance * j; }
  };

  Rows Inside(const qp::ContactCone& cone) {
    Rows x{};
    for (int i = 0; i < NumRows(cone.kind); ++i) x[i] = random_.Uniform(0.1, 1);
    if (cone.kind == qp::ConeKind::kCircular) x[0] = std::hypot(x[1], x[2]) + random_.Uniform(0.1, 1);
    return x;
  }
  static Rows Get(const std::vector<Lanes>& rows, const Entry& e) {
    Rows x{};
    for (int i = 0; i < NumRows(e.cone.kind); ++i) x[i] = rows[e.place.first + i].at[e.place.lane];
    return x;
  }
  static void Put(std::vector<Lanes>* rows, const Entry& e, const Rows& x) {
    for (int i = 0; i < NumRows(e.cone.kind); ++i) (*rows)[e.place.first + i].at[e.place.lane] = x[i];
  }
  static Vector3 Triple(const std::vector<Lanes>& values, const Entry& e) {
    const Lanes* at = &values[3 * e.batch];
    return {at[0].at[e.place.lane], at[1].at[e.place.lane], at[2].at[e.place.lane]};
  }
  Matrix3 Block(const std::vector<Lanes>& values, const Entry& e) {
    Matrix3 block;
    for (int i = 0; i < 9; ++i) block(i / 3, i % 3) = values[9 * e.batch + i].at[e.place.lane];
    return block;
  }
  void ExpectSame(const Rows& a, const Rows& b, const Entry& e) {
    for (int i = 0; i < NumRows(e.cone.kind); ++i) EXPECT_NEAR(a[i], b[i], 1e-11 * (1 + std::abs(b[i])));
  }
  Vector6 Field(const std::vector<double>& y, int body, int field) {
    return Eigen::Map<const Vector6>(&y[12 * body + 6 * field]);
  }
  Vector3 Velocity(const std::vector<double>& y, const Entry& e) {
    const qp::ContactTerm& contact = problem_.contacts[e.contact];
    Vector3 u = contact.jacobian_b * Field(y, contact.body_b, e.field);
    if (contact.body_a >= 0) u += contact.jacobian_a * Field(y, contact.body_a, e.field);
    return u;
  }
  qp::RowArrays Arrays() {
    return {batches_.batches(), qp::kOctagonEdges[0].data(),
            s_.data(),          z_.data(),
            primal_.data(),     lambda_.data(),
            point_.data(),      inverse_.data(),
            softening_.data()};
  }
  qp::RowDirection Direction() { return {target_.data(), ds_.data(), dz_.data(), plain_.data(), constants_.data()}; }
  int End() const { return static_cast<int>(batches_.size()); }

  // The scaling of cone.h, in memory of its own.
  qp::Scaling Reference(const Entry& e, Rows* point, Rows* lambda) {
    qp::Scaling scaling{point->data(), lambda->data(), 0};
    EXPECT_TRUE(UpdateScaling(e.cone.kind, Get(s_, e).data(), Get(z_, e).data(), &scaling));
    return scaling;
  }

  Random random_{87};
  qp::Problem problem_;
  qp::RowBatches batches_;
  std::vector<Entry> entries_;
  const qp::RowKernels* kernels_ = nullptr;
  std::vector<Lanes> s_, z_, point_, inverse_, lambda_, primal_, target_, ds_, dz_, plain_, other_;
  std::vector<Lanes> softening_, d_, constants_, forces_;
  std::vector<double> y_, dy_, correction_;
};

TEST_P(RowKernelsOf, ResidualsAndGather) {
  const qp::RowSums sums = kernels_->residuals(Arrays(), 0, End(), y_.data(), forces_.data());
  double gap = 0, worst = 0;
  std::vector<double> gathered(12 * kBodies), expected(12 * kBodies);
  for (const Entry& e : entries_) {
    const Rows s = Get(s_, e), z = Get(z_, e);
    const Vector3 j = MapFromRows(e.cone, z.data()), force = (e.field == 0 ? 1 : -1) * j;
    Rows mapped{}, primal{};
    MapToRows(e.cone, Velocity(y_, e) + e.offset + e.Yield(j), mapped.data());
    for (int i = 0; i < NumRows(e.cone.kind); ++i) {
      primal[i] = s[i] - mapped[i];
      gap += s[i] * z[i];
      worst = std::max(worst, std::abs(primal[i]));
    }
    ExpectSame(Get(primal_, e), primal, e);
    EXPECT_LT((Triple(forces_, e) - force).norm(), 1e-13);
    const qp::ContactTerm& contact = problem_.contacts[e.contact];
    Eigen::Map<Vector6>(&expected[12 * contact.body_b + 6 * e.field]) += contact.jacobian_b.transpose() * force;
    if (contact.body_a >= 0)
      Eigen::Map<Vector6>(&expected[12 * contact.body_a + 6 * e.field]) += contact.jacobian_a.transpose() * force;
  }
  EXPECT_NEAR(sums.gap, gap, 1e-12 * gap);
  EXPECT_NEAR(sums.worst, worst, 1e-12 * worst);
  batches_.Gather(*kernels_, 0, 2, forces_.data(), gathered.data());
  batches_.Gather(*kernels_, 2, kBodies, forces_.data(), gathered.data());
  for (size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(gathered[i], expected[i], 1e-12);
}

TEST_P(RowKernelsOf, ScalingsAreThoseOfTheCones) {
  ASSERT_TRUE(kernels_->scale(Arrays(), 0, End(), target_.data(), d_.data()));
  for (const Entry& e : entries_) {
    Rows point{}, lambda{}, negative{};
    const qp::Scaling scaling = Reference(e, &point, &lambda);
    ExpectSame(Get(lambda_, e), lambda, e);
    ExpectSame(Get(point_, e), point, e);
    for (int i = 0; i < NumRows(e.cone.kind); ++i) negative[i] = -lambda[i];
    ExpectSame(Get(target_, e), negative, e);
    const Matrix3 plain = ScalingBlock(e.cone, scaling);
    const Matrix3 soft = (Matrix3::Identity() + e.compliance * plain).inverse();
    const Matrix3 d = Block(d_, e);
    EXPECT_LT((d - soft * plain).norm(), 1e-10 * plain.norm());
    EXPECT_EQ(d, d.transpose());
    if (batches_.batches()[e.batch].soft) {
      EXPECT_LT((Block(softening_, e) - soft).norm(), 1e-11 * soft.norm());
    }
  }
  const Entry& e = entries_[kContacts + 5];
  for (const double bad : {-1.0, std::nan("")}) {
    Rows outside = Get(s_, e);
    outside[0] = bad;
    Put(&s_, e, outside);
    EXPECT_FALSE(kernels_->scale(Arrays(), 0, End(), target_.data(), d_.data()));
    EXPECT_TRUE(kernels_->scale(Arrays(), 0, 1, target_.data(), d_.data()));
  }
}

TEST_P(RowKernelsOf, DirectionsSolveTheirEquations) {
  constexpr double kWeight = 0.7;
  kernels_->residuals(Arrays(), 0, End(), y_.data(), forces_.data());
  ASSERT_TRUE(kernels_->scale(Arrays(), 0, End(), target_.data(), d_.data()));
  kernels_->start(Arrays(), Direction(), 0, End(), kWeight, forces_.data());
  const double bound = kernels_->complete(Arrays(), Direction(), 0, End(), kWeight, dy_.data());
  kernels_->forces(Arrays(), Direction(), 0, End(), forces_.data());
  double step = 1e9;
  for (const Entry& e : entries_) {
    Rows point{}, lambda{}, dz{}, ds{};
    const qp::Scaling scaling = Reference(e, &point, &lambda);
    ApplyInverseScaling(e.cone.kind, scaling, Get(dz_, e).data(), dz.data());
    ApplyInverseScaling(e.cone.kind, scaling, Get(plain_, e).data(), ds.data());
    ExpectSame(Get(ds_, e), ds, e);
    const Vector3 dj = MapFromRows(e.cone, dz.data());
    EXPECT_LT((Triple(forces_, e) - (e.field == 0 ? 1 : -1) * dj).norm(), 1e-11 * (1 + dj.norm()));
    EXPECT_LT((Triple(constants_, e) - Block(d_, e) * Velocity(dy_, e) - dj).norm(), 1e-9 * (1 + dj.norm()));
    Rows plain{}, sum{};
    MapToRows(e.cone, Velocity(dy_, e) + e.Yield(dj), plain.data());
    const Rows primal = Get(primal_, e), scaled = Get(ds_, e), other = Get(dz_, e);
    for (int i = 0; i < NumRows(e.cone.kind); ++i) {
      EXPECT_NEAR(Get(plain_, e)[i], plain[i] - kWeight * primal[i], 1e-9 * (1 + dj.norm()));
      sum[i] = scaled[i] + other[i];
    }
    ExpectSame(sum, Get(target_, e), e);
    step = MaxStep(e.cone.kind, lambda.data(), scaled.data(), step);
    step = MaxStep(e.cone.kind, lambda.data(), other.data(), step);
  }
  EXPECT_NEAR(1 / bound, step, 1e-11 * step);
}

TEST_P(RowKernelsOf, CorrectionsAreDifferencesOfDirections) {
  ASSERT_TRUE(kernels_->scale(Arrays(), 0, End(), target_.data(), d_.data()));
  kernels_->start(Arrays(), Direction(), 0, End(), 1, forces_.data());
  kernels_->complete(Arrays(), Direction(), 0, End(), 1, dy_.data());
  const double corrected = kernels_->correct(Arrays(), Direction(), 0, End(), correction_.data());
  const auto plain = plain_, ds = ds_, dz = dz_;
  for (size_t i = 0; i < dy_.size(); ++i) dy_[i] -= correction_[i];
  const double anew = kernels_->complete(Arrays(), Direction(), 0, End(), 1, dy_.data());
  for (const Entry& e : entries_) {
    ExpectSame(Get(plain, e), Get(plain_, e), e);
    ExpectSame(Get(ds, e), Get(ds_, e), e);
    ExpectSame(Get(dz, e), Get(dz_, e), e);
  }
  EXPECT_NEAR(corrected, anew, 1e-11 * anew);
}

TEST_P(RowKernelsOf, TargetsAreThoseOfTheCones) {
  ASSERT_TRUE(kernels_->scale(Arrays(), 0, End(), target_.data(), d_.data()));
  kernels_->start(Arrays(), Direction(), 0, End(), 1, forces_.data());
  kernels_->complete(Arrays(), Direction(), 0, End(), 1, dy_.data());
  kernels_->aim(Arrays(), Direction(), 0, End(), 0.3);
  qp::RowDirection next = Direction();
  next.target = other_.data();
  kernels_->centre(Arrays(), Direction(), next, 0, End(), 0.1, 0.15);
  int corrected = 0;
  for (const Entry& e : entries_) {
    Rows target{};
    const Rows lambda = Get(lambda_, e), ds = Get(ds_, e), dz = Get(dz_, e);
    AimAtCentre(e.cone.kind, lambda.data(), ds.data(), dz.data(), 0.3, target.data());
    ExpectSame(Get(target_, e), target, e);
    const double before = target[0];
    CorrectCentrality(e.cone.kind, lambda.data(), ds.data(), dz.data(), 0.1, 0.15, target.data());
    ExpectSame(Get(other_, e), target, e);
    corrected += target[0] != before;
  }
  EXPECT_GT(corrected, 3);
}

TEST_P(RowKernelsOf, StepsMoveAllButEmptyLanes) {
  ASSERT_TRUE(kernels_->scale(Arrays(), 0, End(), target_.data(), d_.data()));
  kernels_->residuals(Arrays(), 0, End(), y_.data(), forces_.data());
  kernels_->aim(Arrays(), Direction(), 0, End(), 0.3);
  kernels_->start(Arrays(), Direction(), 0, End(), 1, forces_.data());
  kernels_->complete(Arrays(), Direction(), 0, End(), 1, dy_.data());
  std::vector<Rows> moved_s, moved_z;
  for (const Entry& e : entries_) {
    Rows point{}, lambda{}, dz{}, s = Get(s_, e), z = Get(z_, e);
    ApplyInverseScaling(e.cone.kind, Reference(e, &point, &lambda), Get(dz_, e).data(), dz.data());
    for (int i = 0; i < NumRows(e.cone.kind); ++i) s[i] += 0.5 * Get(plain_, e)[i], z[i] += 0.5 * dz[i];
    moved_s.push_back(s), moved_z.push_back(z);
  }
  kernels_->advance(Arrays(), Direction(), 0, End(), 0.5);
  for (size_t r = 0; r < entries_.size(); ++r) {
    ExpectSame(Get(s_, entries_[r]), moved_s[r], entries_[r]);
    ExpectSame(Get(z_, entries_[r]), moved_z[r], entries_[r]);
  }
  std::vector<Lanes> units;
  batches_.FillWithUnits(&units);
  int empty = 0;
  for (int b = 0; b < End(); ++b) {
    const qp::RowBatch& batch = batches_.batches()[b];
    for (int l = 0; l < qp::kRowLanes; ++l) {
      if (batch.used[l] > 0) continue;
      ++empty;
      for (int i = batch.first; i < batch.first + batch.rows; ++i) {
        EXPECT_EQ(s_[i].at[l], units[i].at[l]);
        EXPECT_EQ(z_[i].at[l], units[i].at[l]);
      }
    }
  }
  EXPECT_EQ(empty, 6);
}

// What one machine computes another one does, too.
TEST_P(RowKernelsOf, BitsAreThoseOfTheNarrowest) {
  const qp::RowKernels* const kernels[] = {kernels_, qp::FindRowKernels("sse2")};
  std::vector<double> numbers[2];
  const auto start = std::array{s_, z_, primal_, target_, ds_, dz_, plain_, other_};
  for (int which = 0; which < 2; ++which) {
    const qp::RowKernels& k = *kernels[which];
    s_ = start[0], z_ = start[1], primal_ = start[2], target_ = start[3];
    ds_ = start[4], dz_ = start[5], plain_ = start[6], other_ = start[7];
    std::vector<double>& all = numbers[which];
    const qp::RowSums sums = k.residuals(Arrays(), 0, End(), y_.data(), forces_.data());
    all = {sums.gap, sums.worst};
    ASSERT_TRUE(k.scale(Arrays(), 0, End(), target_.data(), d_.data()));
    k.start(Arrays(), Direction(), 0, End(), 0.7, forces_.data());
    all.push_back(k.complete(Arrays(), Direction(), 0, End(), 0.7, dy_.data()));
    all.push_back(k.correct(Arrays(), Direction(), 0, End(), correction_.data()));
    k.aim(Arrays(), Direction(), 0, End(), 0.3);
    qp::RowDirection next = Direction();
    next.target = other_.data();
    k.centre(Arrays(), Direction(), next, 0, End(), 0.1, 0.15);
    k.forces(Arrays(), Direction(), 0, End(), forces_.data());
    std::vector<double> gathered(12 * kBodies);
    batches_.Gather(k, 0, kBodies, forces_.data(), gathered.data());
    all.insert(all.end(), gathered.begin(), gathered.end());
    k.advance(Arrays(), Direction(), 0, End(), 0.5);
    for (const auto* rows : {&s_, &z_, &point_, &inverse_, &lambda_, &primal_, &target_, &ds_, &dz_, &plain_, &other_})
      for (const Entry& e : entries_) {
        const Rows values = Get(*rows, e);
        all.insert(all.end(), values.begin(), values.end());
      }
    for (const Entry& e : entries_) {
      const Matrix3 block = Block(d_, e);
      all.insert(all.end(), block.data(), block.data() + 9);
    }
  }
  EXPECT_EQ(numbers[0], numbers[1]);
}

INSTANTIATE_TEST_SUITE_P(Sets, RowKernelsOf,
                         ::testing::Combine(::testing::Values("sse2", "avx2", "avx512"),
                                            ::testing::Values(Cone::kCircular, Cone::kOctagon)));

}  // namespace
}  // namespace islet::testing
