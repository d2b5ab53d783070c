#include "qp/gauss_seidel/sweep_order.h"

#include <algorithm>
#include <numeric>

#include "qp/gauss_seidel/sweep_kernels.h"

namespace islet::qp {
namespace {

constexpr int kPartContacts = 3000;  // in a part, more or less: boundaries cost, and their sections are few

}  // namespace

void SweepOrder::Build(const Problem& problem, int num_parts) {
  const int num_contacts = problem.num_contacts();
  // From half a part on they are two: fewer are swept in the time of a few forks.
  if (num_parts <= 0) num_parts = 2 * num_contacts < kPartContacts ? 1 : std::max(num_contacts / kPartContacts, 2);
  part_.assign(problem.bodies.size(), 0);
  if (num_parts > 1) SplitIntoParts(problem, num_parts);
  const int num_sections = AssignSections(problem, num_parts);
  PlaceBodies(num_parts);

  section_start_.assign(num_sections + 1, 0);
  for (int section : section_of_) ++section_start_[section + 1];
  std::partial_sum(section_start_.begin(), section_start_.end(), section_start_.begin());
  members_.resize(num_contacts);
  for (int c = 0; c < num_contacts; ++c) members_[section_start_[section_of_[c]]++] = c;
  for (int s = num_sections; s > 0; --s) section_start_[s] = section_start_[s - 1];
  section_start_[0] = 0;

  num_batches_ = 0;
  contacts_.clear();
  sections_.clear();
  for (int section = 0; section < num_sections; ++section) FillBatches(problem, section);
}

// Bodies that touch, without walls.
void SweepOrder::FindNeighbours(const Problem& problem) {
  neighbour_start_.assign(problem.bodies.size() + 1, 0);
  for (const ContactTerm& contact : problem.contacts) {
    if (contact.body_a < 0 || contact.body_b < 0) continue;
    ++neighbour_start_[contact.body_a + 1];
    ++neighbour_start_[contact.body_b + 1];
  }
  std::partial_sum(neighbour_start_.begin(), neighbour_start_.end(), neighbour_start_.begin());
  neighbours_.resize(neighbour_start_.back());
  for (const ContactTerm& contact : problem.contacts) {
    if (contact.body_a < 0 || contact.body_b < 0) continue;
    neighbours_[neighbour_start_[contact.body_a]++] = contact.body_b;
    neighbours_[neighbour_start_[contact.body_b]++] = contact.body_a;
  }
  for (size_t i = problem.bodies.size(); i > 0; --i) neighbour_start_[i] = neighbour_start_[i - 1];
  neighbour_start_[0] = 0;
}

// Appends the bodies that hang together with this one to the walk, breadth first. Returns the last.
int SweepOrder::WalkFrom(int body) {
  size_t next = walk_.size();
  part_[body] = -1;
  walk_.push_back(body);
  for (; next < walk_.size(); ++next) {
    const int at = walk_[next];
    for (int k = neighbour_start_[at]; k < neighbour_start_[at + 1]; ++k) {
      const int other = neighbours_[k];
      if (part_[other] < 0) continue;
      part_[other] = -1;
      walk_.push_back(other);
    }
  }
  return walk_.back();
}

// Strips of bodies with about as many contacts each.
void SweepOrder::SplitIntoParts(const Problem& problem, int num_parts) {
  FindNeighbours(problem);
  walk_.clear();
  for (int body = 0; body < problem.num_bodies(); ++body) {
    if (part_[body] < 0) continue;
    const size_t start = walk_.size();
    for (int from = body, again = 0; again < 3; ++again) {  // from one end of it, found by walking to and fro
      for (size_t k = start; k < walk_.size(); ++k) part_[walk_[k]] = 0;
      walk_.resize(start);
      from = WalkFrom(from);
    }
  }
  earliest_.assign(problem.bodies.size(), 0);  // contacts per body, those with walls twice
  long total = 0;
  for (const ContactTerm& contact : problem.contacts) {
    earliest_[contact.body_a >= 0 ? contact.body_a : contact.body_b] += 1;
    earliest_[contact.body_b >= 0 ? contact.body_b : contact.body_a] += 1;
    total += 2;
  }
  long before = 0;
  for (int body : walk_) {
    part_[body] = static_cast<int>(std::min<long>(num_parts - 1, before * num_parts / total));
    before += earliest_[body];
  }
}

// Numbers the sections in the order of the phases, without those that have no contacts, but with the first. section_start_ is
// scratch here: first whether a section is used, then its number.
int SweepOrder::AssignSections(const Problem& problem, int num_parts) {
  const int rest = 2 * num_parts;  // after the parts and their boundaries, even ones first
  section_of_.resize(problem.contacts.size());
  section_start_.assign(rest + 1, 0);
  section_start_[0] = !section_of_.empty();  // phase 0 is the parts'
  for (size_t c = 0; c < section_of_.size(); ++c) {
    const ContactTerm& contact = problem.contacts[c];
    const int a = part_[contact.body_a >= 0 ? contact.body_a : contact.body_b];
    const int b = part_[contact.body_b >= 0 ? contact.body_b : contact.body_a];
    const int low = std::min(a, b), gap = std::max(a, b) - low;
    section_of_[c] = gap == 0 ? low : gap > 1 ? rest : num_parts + low / 2 + (low % 2) * (num_parts / 2);
    section_start_[section_of_[c]] = 1;
  }
  int num_sections = 0;
  phase_start_.assign(1, 0);
  for (int section = 0; section <= rest; ++section) {
    const bool phase_ends = section == num_parts || section == num_parts + num_parts / 2 || section == rest;
    if (phase_ends && num_sections > phase_start_.back()) phase_start_.push_back(num_sections);
    const bool used = section_start_[section] > 0;
    section_start_[section] = num_sections;
    num_sections += used;
  }
  if (num_sections > phase_start_.back()) phase_start_.push_back(num_sections);
  for (int& section : section_of_) section = section_start_[section];
  return num_sections;
}

// Bodies of a part without contacts of its own, and so without a section, go with those before. section_start_ still has the
// number of each part's section.
void SweepOrder::PlaceBodies(int num_parts) {
  earliest_.assign(num_parts + 1, 0);  // bodies by part
  for (const int part : part_) ++earliest_[part + 1];
  std::partial_sum(earliest_.begin(), earliest_.end(), earliest_.begin());
  body_start_.clear();
  for (int part = 0; part < num_parts; ++part)
    if (section_start_[part] < section_start_[part + 1]) body_start_.push_back(earliest_[part]);
  body_start_.push_back(earliest_[num_parts]);
  places_.resize(part_.size());
  for (size_t body = 0; body < part_.size(); ++body) places_[body] = earliest_[part_[body]]++;
}

// The first batch from here on that has a free lane.
int SweepOrder::FindRoom(int batch) {
  int root = batch;
  for (; root < static_cast<int>(room_.size()) && room_[root] != root; root = room_[root]) {
  }
  while (batch < static_cast<int>(room_.size()) && room_[batch] != batch) {
    const int next = room_[batch];
    room_[batch] = root;
    batch = next;
  }
  return root;
}

// Each contact goes into the first batch with room behind all earlier contacts of its bodies.
void SweepOrder::FillBatches(const Problem& problem, int section) {
  const int first = section_start_[section], last = section_start_[section + 1];
  earliest_.assign(problem.bodies.size(), 0);
  const auto places = [&](const ContactTerm& contact, auto&& use) {
    if (contact.body_a >= 0) use(earliest_[contact.body_a]);
    if (contact.body_b >= 0) use(earliest_[contact.body_b]);
  };
  used_.clear();
  room_.clear();
  for (int k = first; k < last; ++k) {
    const ContactTerm& contact = problem.contacts[members_[k]];
    int batch = 0;
    places(contact, [&](int& place) { batch = std::max(batch, place); });
    batch = FindRoom(batch);
    while (static_cast<int>(used_.size()) <= batch) {
      room_.push_back(static_cast<int>(used_.size()));
      used_.push_back(0);
      contacts_.insert(contacts_.end(), kBatchLanes, -1);
    }
    contacts_[(num_batches_ + batch) * kBatchLanes + used_[batch]] = members_[k];
    if (++used_[batch] == kBatchLanes) room_[batch] = batch + 1;
    places(contact, [&](int& place) { place = batch + 1; });
  }
  sections_.push_back({num_batches_, static_cast<int>(used_.size())});
  num_batches_ += static_cast<int>(used_.size());
}

}  // namespace islet::qp
