// out: the version of the oneTBB that this process runs on, as "2021.8"     threads: pure function
#pragma once

namespace islet::parallel {

const char* TbbVersion();

}  // namespace islet::parallel
