// The rows of `islet verify` as a table to read and as JSON with every number.
//
//   table: one line per quantity. Of the settings it was measured under the worst one is shown, unless all are asked for;
//          with several models each has a column with its error. A row that does not pass tells its note.
//   verdicts: pass; FAIL, a failed gate; differs, another model than exact Coulomb friction does not meet the bound;
//             outside, a statistic that is not where it should be
#pragma once

#include <span>
#include <string>

#include "scenes/verify/verify_run.h"

namespace islet {

// Worse: farther outside of its bound, counted in bounds. NaN is the worst.
bool Worse(const VerifyRow& a, const VerifyRow& b);

std::string VerifyHeader(std::span<const Setting> settings, bool all_settings);
// Rows of whole checks, measured under these settings.
std::string VerifyTable(std::span<const VerifyRow> rows, std::span<const Setting> settings, bool all_settings);
std::string VerifyJson(std::span<const VerifyRow> rows, double tolerance);

int CountFailedGates(std::span<const VerifyRow> rows);  // quantities, not settings

}  // namespace islet
