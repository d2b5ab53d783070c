// Priority queue of contacts by normal velocity, fastest approach first; ties by contact number, so the order depends on
// the velocities alone. Keys can change while contacts are queued: a binary heap that knows where each contact is.
//   allocation: none after warm-up
#pragma once

#include <algorithm>
#include <span>
#include <utility>
#include <vector>

namespace islet {

class ContactQueue {
 public:
  // keys[i]: [m/s] normal velocity of contact i.
  void Assign(std::span<const double> keys) {
    keys_.assign(keys.begin(), keys.end());
    heap_.resize(keys.size());
    place_.resize(keys.size());
    for (size_t i = 0; i < heap_.size(); ++i) heap_[i] = place_[i] = static_cast<int>(i);
    for (int i = static_cast<int>(heap_.size()) / 2; i-- > 0;) SiftDown(i);
  }
  bool empty() const { return heap_.empty(); }
  int top() const { return heap_[0]; }
  double top_key() const { return keys_[heap_[0]]; }
  // All whose key is no larger, in the order of their numbers.
  void UpTo(double key, std::vector<int>* contacts) const {
    contacts->clear();
    Collect(0, key, contacts);
    std::sort(contacts->begin(), contacts->end());
  }
  void Update(int contact, double key) {
    keys_[contact] = key;
    SiftUp(place_[contact]);
    SiftDown(place_[contact]);
  }

 private:
  bool Before(int a, int b) const { return keys_[a] != keys_[b] ? keys_[a] < keys_[b] : a < b; }
  void Collect(size_t i, double key, std::vector<int>* contacts) const {
    if (i >= heap_.size() || keys_[heap_[i]] > key) return;
    contacts->push_back(heap_[i]);
    Collect(2 * i + 1, key, contacts);
    Collect(2 * i + 2, key, contacts);
  }
  void Swap(int i, int j) {
    std::swap(heap_[i], heap_[j]);
    place_[heap_[i]] = i;
    place_[heap_[j]] = j;
  }
  void SiftUp(int i) {
    for (; i > 0 && Before(heap_[i], heap_[(i - 1) / 2]); i = (i - 1) / 2) Swap(i, (i - 1) / 2);
  }
  void SiftDown(int i) {
    for (const int n = static_cast<int>(heap_.size());;) {
      int first = i;
      for (int child = 2 * i + 1; child <= 2 * i + 2 && child < n; ++child)
        if (Before(heap_[child], heap_[first])) first = child;
      if (first == i) return;
      Swap(i, first);
      i = first;
    }
  }

  std::vector<double> keys_;
  std::vector<int> heap_, place_;
};

}  // namespace islet
