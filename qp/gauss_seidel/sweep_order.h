// The order in which Gauss-Seidel sweeps visit contacts: which eight make a batch, and which batches may be swept side
// by side. It depends on the contact graph alone, never on the number of threads.
//
//   part 0   | boundary | part 1   | boundary | part 2 ...      strips of bodies, breadth first from one end of the island
//
// Contacts inside a part are one section; contacts between neighbouring parts are swept after them. Within a section two
// contacts that share a body keep the order of the problem: batches only move contacts past those that they do not touch.
//
//   phase 0   the parts
//   phase 1   boundaries 0|1, 2|3 ...     sections of a phase share no body
//   phase 2   boundaries 1|2, 3|4 ...
//   phase 3   the rest, where breadth-first levels are thicker than a part: one section
//
//   threads: one order per solver; allocates only while problems grow
#pragma once

#include <vector>

#include "qp/problem.h"

namespace islet::qp {

class SweepOrder {
 public:
  // num_parts: 1 keeps the order of the problem; 0: as many as are worth the trouble of other threads.
  void Build(const Problem& problem, int num_parts = 0);

  struct Section {
    int first_batch, num_batches;
  };
  int num_batches() const { return num_batches_; }
  const std::vector<Section>& sections() const { return sections_; }  // the first may have no batches
  // Sections phase_start()[p] up to phase_start()[p + 1] belong to phase p.
  const std::vector<int>& phase_start() const { return phase_start_; }
  // The contact in each lane of each batch, or -1.
  const std::vector<int>& contacts() const { return contacts_; }
  // Where each body is when bodies are sorted by parts. Places body_start()[s] up to body_start()[s + 1] are touched by no
  // section of phase 0 but s.
  const std::vector<int>& places() const { return places_; }
  const std::vector<int>& body_start() const { return body_start_; }

 private:
  void FindNeighbours(const Problem& problem);
  int WalkFrom(int body);
  void SplitIntoParts(const Problem& problem, int num_parts);
  int AssignSections(const Problem& problem, int num_parts);
  void PlaceBodies(int num_parts);
  void FillBatches(const Problem& problem, int section);
  int FindRoom(int batch);

  int num_batches_ = 0;
  std::vector<Section> sections_;
  std::vector<int> phase_start_, contacts_;
  std::vector<int> neighbour_start_, neighbours_, walk_, part_;  // bodies
  std::vector<int> section_of_, section_start_, members_;        // contacts by section
  std::vector<int> places_, body_start_;                         // per body; per section of phase 0
  std::vector<int> earliest_;                                    // batch, per body
  std::vector<int> used_, room_;  // per batch: lanes in use; next batch that may have room
};

}  // namespace islet::qp
