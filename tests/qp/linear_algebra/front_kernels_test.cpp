#include "qp/linear_algebra/front_kernels.h"

#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "qp/build_facts.h"
#include "qp/problem.h"
#include "tests/support/random_problems.h"

namespace islet::testing {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

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
struct TestFront {
  TestFront(const MatrixXd& a, int columns, int block) : front(static_cast<int>(a.rows()), columns, block) {
    const int n = front.n, k = front.k, m = n - k;
    panel.assign(front.PanelSize(), kNaN);
    update.assign(front.UpdateSize(), kNaN);
    scratch.assign(front.ScratchSize(), kNaN);
    front.panel = panel.data(), front.update = update.data(), front.scratch = scratch.data();
    for (int j = 0; j < k; ++j)
      for (int i = j; i < n; ++i) panel[front.lead + i + j * front.panel_stride] = a(i, j);
    for (int j = 0; j < m; ++j)
      for (int i = j; i < m; ++i) update[i + j * front.update_stride] = a(k + i, k + j);
  }
  TestFront(const TestFront&) = delete;
  int Factorise(const qp::FrontKernels& kernels, const VectorXd& signs) {
    front.signs = signs.data();
    return kernels.factorise(front);
  }
  // Line by line from the end, as badly split as can be.
  int FactoriseInParts(const qp::FrontKernels& kernels, const VectorXd& signs) {
    front.signs = signs.data();
    int replaced = 0;
    for (int j = 0; j < front.k; j += qp::kPanelBlock) {
      replaced += kernels.eliminate(front, j);
      for (int end = front.EndLine(); end > front.SolveBegin(j); end -= qp::kVector)
        kernels.solve_lines(front, j, end - qp::kVector, end);
      for (int end = front.EndLine(); end > front.UpdateBegin(j); end -= qp::kVector)
        kernels.update_lines(front, j, end - qp::kVector, end);
    }
    return replaced;
  }
  MatrixXd Lower() const {  // n x k
    MatrixXd l = MatrixXd::Zero(front.n, front.k);
    for (int j = 0; j < front.k; ++j) {
      for (int i = j; i < front.n; ++i) l(i, j) = panel[front.lead + i + j * front.panel_stride];
      l(j, j) = 1 / l(j, j);
    }
    return l;
  }
  MatrixXd Update() const {
    const int m = front.n - front.k;
    MatrixXd u(m, m);
    for (int j = 0; j < m; ++j)
      for (int i = j; i < m; ++i) u(i, j) = u(j, i) = update[i + j * front.update_stride];
    return u;
  }
  // One number per line, NaN where there is no row.
  VectorXd Lines(const VectorXd& x) const {
    VectorXd lines = VectorXd::Constant(front.EndLine(), kNaN);
    lines.segment(front.lead, front.n) = x;
    return lines;
  }
  VectorXd Rows(const VectorXd& lines) const { return lines.segment(front.lead, front.n); }
  qp::Front front;
  std::vector<double> panel, update, scratch;
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

TEST_P(FrontKernels, DiagonalByHand) {
  TestFront front(4 * MatrixXd::Identity(6, 6), 6, 6);
  EXPECT_EQ(front.Factorise(*kernels_, VectorXd::Ones(6)), 0);
  EXPECT_EQ(front.Lower(), 2 * MatrixXd::Identity(6, 6));
  TestFront negative(-9 * MatrixXd::Identity(6, 6), 6, 6);
  EXPECT_EQ(negative.Factorise(*kernels_, -VectorXd::Ones(6)), 0);
  EXPECT_LT((negative.Lower().cwiseAbs() - 3 * MatrixXd::Identity(6, 6)).norm(), 1e-14);
}

// Sizes with every even remainder modulo the vector, every k, signs mixed and not.
TEST_P(FrontKernels, FactoriseAgreesWithPlainCholesky) {
  for (const int block : {6, 12}) {
    for (int n = block; n <= 72; n += block) {
      for (int k = block; k <= n; k += block) {
        const VectorXd signs = RandomSigns(n, (n + k) / block % 2 == 0);
        const MatrixXd a = RandomQuasiDefinite(&random_, signs);
        TestFront front(a, k, block);
        MatrixXd lower, update;
        PlainCholesky(a, k, signs, &lower, &update);
        ASSERT_EQ(front.Factorise(*kernels_, signs), 0) << "block " << block << " n " << n << " k " << k;
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

// Several panel blocks; in parts the same bits; an update matrix that is overwritten equals one of zeros.
TEST_P(FrontKernels, LargeFrontsInPartsHaveTheSameBits) {
  for (const int block : {6, 12}) {
    for (const auto [n, k] : {std::array{96, 96}, {108, 96}, {204, 108}, {300, 300}, {312, 204}}) {
      SCOPED_TRACE(n * 1000 + k);
      const VectorXd signs = RandomSigns(n, true);
      MatrixXd a = RandomQuasiDefinite(&random_, signs);
      a.bottomRightCorner(n - k, n - k).setZero();
      TestFront whole(a, k, block), parts(a, k, block);
      MatrixXd lower, update;
      PlainCholesky(a, k, signs, &lower, &update);
      std::fill(parts.update.begin(), parts.update.end(), kNaN);
      parts.front.fresh = true;
      ASSERT_EQ(whole.Factorise(*kernels_, signs), 0);
      ASSERT_EQ(parts.FactoriseInParts(*kernels_, signs), 0);
      EXPECT_LT((whole.Lower() - lower).cwiseAbs().maxCoeff(), 1e-12);
      EXPECT_TRUE((whole.Lower().array() == parts.Lower().array()).all());
      if (n == k) continue;
      EXPECT_LT((whole.Update() - update).cwiseAbs().maxCoeff(), 1e-12);
      EXPECT_TRUE((whole.Update().array() == parts.Update().array()).all());
    }
  }
}

TEST_P(FrontKernels, ForwardAndBackward) {
  const auto check = [&](int n, int k, int block) {
    SCOPED_TRACE(::testing::Message() << "n " << n << " k " << k << " block " << block);
    const qp::FrontKernels& kernels = *kernels_;
    const VectorXd signs = RandomSigns(n, true);
    TestFront front(RandomQuasiDefinite(&random_, signs), k, block);
    front.Factorise(kernels, signs);
    const MatrixXd lower = front.Lower();
    const auto top = lower.topRows(k).triangularView<Eigen::Lower>();
    const VectorXd b = VectorXd::NullaryExpr(n, [&] { return random_.Uniform(-1, 1); });
    VectorXd expected = b;
    expected.head(k) = top.solve(b.head(k)).eval();
    expected.tail(n - k) -= lower.bottomRows(n - k) * expected.head(k);
    VectorXd x = front.Lines(b);
    kernels.forward(front.front, x.data());
    ASSERT_LT((front.Rows(x) - expected).norm(), 1e-13 * n);
    VectorXd parts = front.Lines(b);
    for (int j = 0; j < k; j += qp::kPanelBlock) {
      kernels.forward_block(front.front, j, parts.data());
      for (int end = front.front.EndLine(); end > front.front.SolveBegin(j); end -= qp::kVector)
        kernels.forward_lines(front.front, j, end - qp::kVector, end, parts.data());
    }
    ASSERT_TRUE((front.Rows(parts).array() == front.Rows(x).array()).all());
    expected = b;
    expected.head(k) = top.transpose().solve(b.head(k) - lower.bottomRows(n - k).transpose() * b.tail(n - k)).eval();
    x = front.Lines(b);
    kernels.backward(front.front, x.data());
    ASSERT_LT((front.Rows(x) - expected).norm(), 1e-13 * n);
  };
  for (int n = 6; n <= 60; n += 6)
    for (int k = 6; k <= n; k += 6) check(n, k, 6);
  check(300, 204, 6);
  check(300, 300, 12);
}

// A pivot of the wrong sign is counted, and its row drops out: the rest is solved as if it were not there.
TEST_P(FrontKernels, WrongPivotIsReplacedAndCounted) {
  for (const int block : {6, 12}) {
    const int n = 24;
    for (int bad = 0; bad < n; ++bad) {
      const VectorXd signs = RandomSigns(n, true);
      MatrixXd a = RandomQuasiDefinite(&random_, signs);
      a(bad, bad) = -a(bad, bad) * 100;
      TestFront front(a, n, block);
      ASSERT_EQ(front.Factorise(*kernels_, signs), 1) << "block " << block << " row " << bad;
      const VectorXd b = VectorXd::NullaryExpr(n, [&] { return random_.Uniform(-1, 1); });
      VectorXd lines = front.Lines(b);
      kernels_->forward(front.front, lines.data());
      lines = front.Lines(front.Rows(lines).cwiseProduct(signs));
      kernels_->backward(front.front, lines.data());
      const VectorXd x = front.Rows(lines);
      EXPECT_NEAR(x[bad], 0, 1e-50);
      a.row(bad).setZero(), a.col(bad).setZero(), a(bad, bad) = 1;
      VectorXd rest = b;
      rest[bad] = 0;
      EXPECT_LT((x - a.lu().solve(rest)).norm(), 1e-12);
    }
  }
}

TEST_P(FrontKernels, ZeroAndNaNPivotsAreReplaced) {
  for (const double pivot : {0.0, kNaN}) {
    MatrixXd a = MatrixXd::Identity(6, 6);
    a(2, 2) = pivot;
    TestFront front(a, 6, 6);
    EXPECT_EQ(front.Factorise(*kernels_, VectorXd::Ones(6)), 1);
    EXPECT_TRUE(front.Lower().allFinite());
  }
}

// Rows of a child: some in the panel, some in the update matrix, in runs and alone; in one go and column by column.
TEST_P(FrontKernels, ExtendAdd) {
  for (const int block : {6, 12}) {
    const std::vector<int> to = {0, 2, 3, 4, 6, 9, 10};
    const int nodes = 11, columns = 4, m = static_cast<int>(to.size()), n = nodes * block;
    const auto symmetric = [&](int size) {
      const MatrixXd any = MatrixXd::NullaryExpr(size, size, [&] { return random_.Uniform(-1, 1); });
      return MatrixXd(any + any.transpose());
    };
    const MatrixXd a = symmetric(n), added = symmetric(m * block);
    TestFront parent(a, columns * block, block), by_column(a, columns * block, block);
    const int stride = qp::OddStride(m * block);
    std::vector<double> child(stride * m * block, kNaN);
    for (int j = 0; j < m * block; ++j)
      for (int i = j; i < m * block; ++i) child[i + j * stride] = added(i, j);
    kernels_->extend_add(parent.front, m, to.data(), child.data(), 0, m);
    for (int c = 0; c < m; ++c) kernels_->extend_add(by_column.front, m, to.data(), child.data(), c, c + 1);
    MatrixXd sum = a;
    for (int i = 0; i < m; ++i)
      for (int j = 0; j < m; ++j)
        sum.block(to[i] * block, to[j] * block, block, block) += added.block(i * block, j * block, block, block);
    for (const TestFront* front : {&parent, &by_column}) {
      for (int j = 0; j < n; ++j) {
        for (int i = j; i < n; ++i) {
          const qp::Front& f = front->front;
          ASSERT_EQ(j < f.k ? front->panel[f.lead + i + j * f.panel_stride]
                            : front->update[i - f.k + (j - f.k) * f.update_stride],
                    sum(i, j))
              << i << " " << j;
        }
      }
    }
  }
}

TEST_P(FrontKernels, AddProducts) {
  const int contacts = 3;
  std::vector<double> rows(2 * contacts * 24, 0.0), d;
  std::vector<qp::Jacobian> jacobians;
  for (int s = 0; s < 2 * contacts; ++s) {
    jacobians.push_back(qp::Jacobian::NullaryExpr([&] { return random_.Uniform(-1, 1); }));
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 6; ++c) rows[24 * s + 8 * r + c] = jacobians[s](r, c);
  }
  Eigen::Matrix<double, 6, 6> expected = Eigen::Matrix<double, 6, 6>::Ones();
  std::vector<qp::ContactProduct> products;
  for (int c = 0; c < contacts; ++c) {
    const qp::Matrix3 inner = random_.PositiveDefinite(0.1, 10);
    d.insert(d.end(), inner.data(), inner.data() + 9);
    expected -= jacobians[2 * c].transpose() * inner * jacobians[2 * c + 1];
    products.push_back({2 * c, 2 * c + 1, c});
  }
  MatrixXd out = MatrixXd::Constant(7, 7, kNaN);
  out.topLeftCorner<6, 6>().setOnes();
  kernels_->add_products(contacts, products.data(), rows.data(), d.data(), -1, out.data(), 7);
  EXPECT_LT((out.topLeftCorner<6, 6>() - expected).norm(), 1e-13);
  EXPECT_TRUE(std::isnan(out(6, 0)) && std::isnan(out(0, 6)));
}

// What one machine computes another one does, too.
TEST_P(FrontKernels, BitsAreThoseOfTheNarrowest) {
  const qp::FrontKernels& narrow = *qp::FindFrontKernels("sse2");
  const auto check = [&](int n, int k, int block) {
    SCOPED_TRACE(::testing::Message() << "n " << n << " k " << k << " block " << block);
    const VectorXd signs = RandomSigns(n, true);
    const MatrixXd a = RandomQuasiDefinite(&random_, signs);
    const VectorXd b = VectorXd::NullaryExpr(n, [&] { return random_.Uniform(-1, 1); });
    const auto all = [&](const qp::FrontKernels& kernels) {
      TestFront front(a, k, block);
      front.Factorise(kernels, signs);
      VectorXd x = front.Lines(b), y = front.Lines(b);
      kernels.forward(front.front, x.data());
      kernels.backward(front.front, y.data());
      std::vector<double> numbers;
      for (const MatrixXd& part : {front.Lower(), front.Update(), MatrixXd(front.Rows(x)), MatrixXd(front.Rows(y))})
        numbers.insert(numbers.end(), part.data(), part.data() + part.size());
      return numbers;
    };
    EXPECT_EQ(all(*kernels_), all(narrow));
  };
  for (const int block : {6, 12})
    for (int n = block; n <= 60; n += block)
      for (int k = block; k <= n; k += block) check(n, k, block);
  check(300, 204, 6);
  const qp::ContactProduct product{0, 1, 0};
  std::vector<double> rows(2 * 24, 0.0), d(9), sums[2] = {std::vector<double>(36), std::vector<double>(36)};
  for (double& value : d) value = random_.Uniform(-1, 1);
  for (int i = 0; i < 36; ++i) rows[8 * (i / 6) + i % 6] = random_.Uniform(-1, 1);
  kernels_->add_products(1, &product, rows.data(), d.data(), 1, sums[0].data(), 6);
  narrow.add_products(1, &product, rows.data(), d.data(), 1, sums[1].data(), 6);
  EXPECT_EQ(sums[0], sums[1]);
}

INSTANTIATE_TEST_SUITE_P(Sets, FrontKernels, ::testing::Values("sse2", "avx2", "avx512"),
                         [](const auto& set) { return std::string(set.param); });

TEST(FrontKernelSets, TheBestIsOneOfThem) {
  EXPECT_EQ(qp::FindFrontKernels(qp::ChosenKernels()), &qp::BestFrontKernels());
  EXPECT_EQ(qp::FindFrontKernels("mmx"), nullptr);
  EXPECT_NE(qp::FindFrontKernels("sse2"), nullptr);
}

}  // namespace
}  // namespace islet::testing
