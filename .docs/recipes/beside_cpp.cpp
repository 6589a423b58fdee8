// The controller of beside_cpp.py: writes its state into a file in /dev/shm at 1 kHz.
//
// A sequence counter makes a state whole for its reader: odd while it is written. Nothing here waits for anybody.
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fcntl.h>
#include <sys/mman.h>
#include <thread>
#include <unistd.h>

struct State {  // beside_cpp.py has the same as a NumPy dtype
  std::atomic<uint64_t> sequence;
  int64_t time_ns;
  double q[12];
  double torque[12];
  uint8_t mode;
};
static_assert(std::atomic<uint64_t>::is_always_lock_free && sizeof(State) == 216);

int main(int argc, char** argv) {
  if (argc < 3) return 2;
  const int file = open(argv[1], O_RDWR | O_CREAT, 0600);
  if (file < 0 || ftruncate(file, sizeof(State))) { std::perror(argv[1]); return 1; }
  void* memory = mmap(nullptr, sizeof(State), PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
  if (memory == MAP_FAILED) { std::perror("mmap"); return 1; }
  auto& state = *static_cast<State*>(memory);
  auto deadline = std::chrono::steady_clock::now();
  for (int tick = 0; tick < std::atoi(argv[2]); ++tick) {
    state.sequence.fetch_add(1, std::memory_order_acquire);
    std::atomic_thread_fence(std::memory_order_release);
    state.time_ns = std::chrono::system_clock::now().time_since_epoch() / std::chrono::nanoseconds(1);
    for (int i = 0; i < 12; ++i) { state.q[i] = tick + i; state.torque[i] = -state.q[i]; }
    state.mode = tick % 3;
    state.sequence.fetch_add(1, std::memory_order_release);
    std::this_thread::sleep_until(deadline += std::chrono::milliseconds(1));
  }
}
