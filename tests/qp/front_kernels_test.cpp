#include "qp/front_kernels.h"

#include <cmath>
#include <limits>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "tests/support/random_problems.h"

namespace islet::testing {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using qp::PaddedRows;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// A symmetric quasi-definite matrix for the given signs: S_i A_ij positive definite among equal signs, the rest
// arbitrary.
MatrixXd RandomQuasiDefinite(Random* random, const VectorXd& signs) {
  const int n = static_cast<int>(signs.size());
  MatrixXd a(n, n);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j <= i; ++j) a(i, j) = a(j, i) = random->Uniform(-1, 1);
  for (int i = 0; i < n; ++i) a(i, i) = signs[i] * (n + random->Uniform(0, 1));
  return a;
}

// One front whose scratch parts hold NaN: nothing may leak out of them.
struct Front {
  Front(const MatrixXd& a, int columns) : n(static_cast<int>(a.rows())), k(columns) {
    const int lda = PaddedRows(n), m = n - k, ldu = PaddedRows(m);
    panel.assign(static_cast<size_t>(lda) * k + qp::kRowPadding, kNaN);
    update.assign(static_cast<size_t>(ldu) * m + qp::kRowPadding, kNaN);
    for (int j = 0; j < k; ++j)
      for (int i = j; i < n; ++i) panel[i + j * lda] = a(i, j);
    for (int j = 0; j < m; ++j)
      for (int i = j; i < m; ++i) update[i + j * ldu] = a(k + i, k + j);
  }
  int Factorise(const qp::FrontKernels& kernels, int block, const VectorXd& signs, double tiny = 0) {
    return kernels.factorise(n, k, block, tiny, signs.data(), panel.data(), n == k ? nullptr : update.data());
  }
  MatrixXd Lower() const {  // n x k
    MatrixXd l = MatrixXd::Zero(n, k);
    for (int j = 0; j < k; ++j)
      for (int i = j; i < n; ++i) l(i, j) = panel[i + j * PaddedRows(n)];
    return l;
  }
  MatrixXd Update() const {
    const int m = n - k;
    MatrixXd u(m, m);
    for (int j = 0; j < m; ++j)
      for (int i = j; i < m; ++i) u(i, j) = u(j, i) = update[i + j * PaddedRows(m)];
    return u;
  }
  int n, k;
  std::vector<double> panel, update;
};

// L (n x k) with A = L S L^T + [0 0; 0 U], and U, the plain way.
void PlainCholesky(MatrixXd a, int k, const VectorXd& signs, MatrixXd* lower, MatrixXd* update) {
  const int n = static_cast<int>(a.rows());
  *lower = MatrixXd::Zero(n, k);
  for (int j = 0; j < k; ++j) {
    const double root = std::sqrt(signs[j] * a(j, j));
    for (int i = j; i < n; ++i) (*lower)(i, j) = signs[j] * a(i, j) / root;
    for (int p = j; p < n; ++p)
      for (int q = j; q < n; ++q) a(p, q) -= signs[j] * (*lower)(p, j) * (*lower)(q, j);
  }
  *update = a.bottomRightCorner(n - k, n - k);
}

class FrontKernels : public ::testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    kernels_ = qp::FindFrontKernels(GetParam());
    if (kernels_ == nullptr) GTEST_SKIP() << "this machine has no " << GetParam();
  }
  VectorXd RandomSigns(int n, bool mixed) {
    VectorXd signs = VectorXd::Ones(n);
    for (int i = 0; mixed && i < n; ++i) signs[i] = random_.Integer(0, 1) ? 1 : -1;
    return signs;
  }
  const qp::FrontKernels* kernels_ = nullptr;
  Random random_{21};
};

TEST_P(FrontKernels, OneByOne) {
  Front front(MatrixXd::Constant(1, 1, 4), 1);
  EXPECT_EQ(front.Factorise(*kernels_, 1, VectorXd::Ones(1)), 0);
  EXPECT_EQ(front.Lower()(0, 0), 2);
  Front negative(MatrixXd::Constant(1, 1, -9), 1);
  EXPECT_EQ(negative.Factorise(*kernels_, 1, -VectorXd::Ones(1)), 0);
  EXPECT_EQ(std::abs(negative.Lower()(0, 0)), 3);
}

// Sizes with every remainder modulo the padding of 8, every k, signs mixed and not.
TEST_P(FrontKernels, FactoriseAgreesWithPlainCholesky) {
  for (const int block : {1, 3, 6, 12}) {
    const int largest = block == 1 ? 26 : block == 3 ? 39 : 72;
    for (int n = block; n <= largest; n += block) {
      for (int k = block; k <= n; k += block) {
        const VectorXd signs = RandomSigns(n, (n + k) / block % 2 == 0);
        const MatrixXd a = RandomQuasiDefinite(&random_, signs);
        Front front(a, k);
        MatrixXd lower, update;
        PlainCholesky(a, k, signs, &lower, &update);
        ASSERT_EQ(front.Factorise(*kernels_, block, signs), 0) << "block " << block << " n " << n << " k " << k;
        ASSERT_LT((front.Lower() - lower).cwiseAbs().maxCoeff(), 1e-13 * n)
            << "block " << block << " n " << n << " k " << k;
        if (n > k) {
          ASSERT_LT((front.Update() - update).cwiseAbs().maxCoeff(), 1e-13 * n)
              << "block " << block << " n " << n << " k " << k;
        }
      }
    }
  }
}

TEST_P(FrontKernels, ForwardAndBackward) {
  for (int n = 1; n <= 30; ++n) {
    for (int k = 1; k <= n; ++k) {
      const VectorXd signs = RandomSigns(n, true);
      Front front(RandomQuasiDefinite(&random_, signs), k);
      front.Factorise(*kernels_, 1, signs);
      const MatrixXd lower = front.Lower();
      const auto top = lower.topRows(k).triangularView<Eigen::Lower>();
      const VectorXd b = VectorXd::NullaryExpr(n, [&] { return random_.Uniform(-1, 1); });
      VectorXd expected = b;
      expected.head(k) = top.solve(b.head(k)).eval();
      expected.tail(n - k) -= lower.bottomRows(n - k) * expected.head(k);
      VectorXd x = b;
      kernels_->forward(n, k, front.panel.data(), x.data());
      ASSERT_LT((x - expected).norm(), 1e-13 * n) << n << " " << k;
      expected = b;
      expected.head(k) = top.transpose().solve(b.head(k) - lower.bottomRows(n - k).transpose() * b.tail(n - k)).eval();
      x = b;
      kernels_->backward(n, k, front.panel.data(), x.data());
      ASSERT_LT((x - expected).norm(), 1e-13 * n) << n << " " << k;
    }
  }
}

// A pivot of the wrong sign is counted, and its row drops out: the rest is solved as if it were not there.
TEST_P(FrontKernels, WrongPivotIsReplacedAndCounted) {
  for (const int block : {1, 3, 6, 12}) {
    const int n = 24;
    for (int bad = 0; bad < n; ++bad) {
      const VectorXd signs = RandomSigns(n, true);
      MatrixXd a = RandomQuasiDefinite(&random_, signs);
      a(bad, bad) = -a(bad, bad) * 100;
      Front front(a, n);
      ASSERT_EQ(front.Factorise(*kernels_, block, signs), 1) << "block " << block << " row " << bad;
      const VectorXd b = VectorXd::NullaryExpr(n, [&] { return random_.Uniform(-1, 1); });
      VectorXd x = b;
      kernels_->forward(n, n, front.panel.data(), x.data());
      x = x.cwiseProduct(signs);
      kernels_->backward(n, n, front.panel.data(), x.data());
      EXPECT_NEAR(x[bad], 0, 1e-50);
      a.row(bad).setZero(), a.col(bad).setZero(), a(bad, bad) = 1;
      VectorXd rest = b;
      rest[bad] = 0;
      EXPECT_LT((x - a.lu().solve(rest)).norm(), 1e-12);
    }
  }
}

TEST_P(FrontKernels, ZeroNaNAndTinyPivotsAreReplaced) {
  for (const double pivot : {0.0, kNaN, 1e-3}) {
    MatrixXd a = MatrixXd::Identity(6, 6);
    a(2, 2) = pivot;
    Front front(a, 6);
    EXPECT_EQ(front.Factorise(*kernels_, 6, VectorXd::Ones(6), 1e-2), 1);
    EXPECT_TRUE(front.Lower().allFinite());
  }
}

INSTANTIATE_TEST_SUITE_P(Sets, FrontKernels, ::testing::Values("sse2", "avx2", "avx512"),
                         [](const auto& set) { return std::string(set.param); });

TEST(FrontKernelSets, TheBestIsOneOfThem) {
  EXPECT_EQ(qp::FindFrontKernels(qp::BestFrontKernels().name), &qp::BestFrontKernels());
  EXPECT_EQ(qp::FindFrontKernels("mmx"), nullptr);
  EXPECT_NE(qp::FindFrontKernels("sse2"), nullptr);
}

}  // namespace
}  // namespace islet::testing
