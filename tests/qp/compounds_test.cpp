#include "qp/compounds.h"
