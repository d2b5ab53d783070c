// out: the version of FCL that the engine was compiled with, as "0.7.0"     threads: pure function
#pragma once

namespace islet {

const char* FclVersion();

}  // namespace islet
