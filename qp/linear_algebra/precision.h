// Single precision where its rounding does no harm: factors of the interior point early on, sweeps far from the answer. What is
// returned is always double.
#pragma once

namespace islet::qp {

enum class Precision { kDouble, kSingle };

inline constexpr int kSingleBodies = 64;  // in smaller islands it saves nothing that shows

}  // namespace islet::qp
