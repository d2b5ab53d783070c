#include "qp/linear_algebra/front_kernels.h"

#include <cstdlib>
#include <cstring>
#include <initializer_list>

namespace islet::qp {

extern const FrontKernelSetOf<double> kSse2Kernels;
extern const FrontKernelSetOf<float> kSse2SingleKernels;
#ifdef ISLET_WIDE_KERNELS
extern const FrontKernelSetOf<double> kAvx2Kernels, kAvx512Kernels;
extern const FrontKernelSetOf<float> kAvx2SingleKernels, kAvx512SingleKernels;
#endif

namespace {

template <typename Number>
const Number* Choose(const char* name, const Number* sse2, const Number* avx2, const Number* avx512) {
#ifdef ISLET_WIDE_KERNELS
  const bool has_avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  if (std::strcmp(name, "avx2") == 0) return has_avx2 ? avx2 : nullptr;
  if (std::strcmp(name, "avx512") == 0) {
    return has_avx2 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") ? avx512 : nullptr;
  }
#else
  static_cast<void>(avx2), static_cast<void>(avx512);
#endif
  return std::strcmp(name, "sse2") == 0 ? sse2 : nullptr;
}

}  // namespace

template <>
const FrontKernelSetOf<double>* FindFrontKernelsOf(const char* name) {
#ifdef ISLET_WIDE_KERNELS
  return Choose(name, &kSse2Kernels, &kAvx2Kernels, &kAvx512Kernels);
#else
  return Choose<FrontKernelSetOf<double> >(name, &kSse2Kernels, nullptr, nullptr);
#endif
}

template <>
const FrontKernelSetOf<float>* FindFrontKernelsOf(const char* name) {
#ifdef ISLET_WIDE_KERNELS
  return Choose(name, &kSse2SingleKernels, &kAvx2SingleKernels, &kAvx512SingleKernels);
#else
  return Choose<FrontKernelSetOf<float> >(name, &kSse2SingleKernels, nullptr, nullptr);
#endif
}

template <typename Number>
const FrontKernelSetOf<Number>& BestFrontKernelsOf() {
  static const FrontKernelSetOf<Number>& best = []() -> const FrontKernelSetOf<Number>& {
    if (const char* wanted = std::getenv("ISLET_KERNELS")) {
      if (const auto* set = FindFrontKernelsOf<Number>(wanted)) return *set;
    }
    for (const char* name : {"avx512", "avx2"}) {
      if (const auto* set = FindFrontKernelsOf<Number>(name)) return *set;
    }
    return *FindFrontKernelsOf<Number>("sse2");
  }();
  return best;
}

template const FrontKernelSetOf<double>& BestFrontKernelsOf<double>();
template const FrontKernelSetOf<float>& BestFrontKernelsOf<float>();

}  // namespace islet::qp
