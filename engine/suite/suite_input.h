// What a caller of ContactSuite::Resolve must hand in, checked in one pass: each message names what, its number, the field and the value.
//   errors: std::invalid_argument    threads: pure functions    allocation: none unless something is wrong
#pragma once

#include <span>

#include "engine/body.h"
#include "engine/contact.h"

namespace islet {

void CheckSuiteBodies(std::span<const Body> bodies);
// Also that they are in canonical order.
void CheckSuiteContacts(std::span<const Contact> contacts, std::span<const Body> bodies);

}  // namespace islet
