// What every client does before it resolves velocities: overlaps are undone by the smallest displacements, and the contacts' gaps follow.
//
// Hosts find bodies only once they overlap. What is deep by then is undone a share a step, or it would be pushed into neighbours not found yet.
#pragma once

#include <span>
#include <vector>

#include "engine/contact_suite.h"

namespace islet::clients {

// Whether a contact of these two touches: the host's own word is "overlaps", and a body at rest does so in every other step.
bool Touches(const Contact& contact, std::span<const Body> bodies);

// Moves the bodies by suite->Project(). `scratch` is overwritten.
void UndoOverlaps(std::span<Body> bodies, std::span<Contact> contacts, std::vector<Contact>* scratch,
                  ContactSuite* suite);

}  // namespace islet::clients
