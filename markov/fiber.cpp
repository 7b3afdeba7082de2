#include "markov/fiber.h"

#include <cxxabi.h>
#include <sys/mman.h>
#include <ucontext.h>

#include <array>
#include <cstring>
#include <mutex>
#include <new>
#include <utility>
#include <vector>

#ifdef __SANITIZE_ADDRESS__
#include <sanitizer/common_interface_defs.h>
#endif
#ifdef __SANITIZE_THREAD__
#include <sanitizer/tsan_interface.h>
#endif

namespace metastable::markov {
namespace {

constexpr std::size_t stack_size = 8 << 20, guard_size = 1 << 16;  // bytes; a stack that overflows meets the guard

// Stacks are kept for the next fiber: the system would have to clear their pages anew.
class Stacks {
 public:
  static Stacks& all() {
    static Stacks stacks;
    return stacks;
  }
  void* take() {
    {
      const std::lock_guard lock(mutex_);
      if (!free_.empty()) {
        void* one = free_.back();
        free_.pop_back();
        return one;
      }
    }
    void* one = mmap(nullptr, stack_size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_STACK, -1, 0);
    if (one == MAP_FAILED || mprotect(one, guard_size, PROT_NONE) != 0) throw std::bad_alloc();
    return one;
  }
  void give_back(void* one) {
    const std::lock_guard lock(mutex_);
    free_.push_back(one);
  }

 private:
  std::mutex mutex_;
  std::vector<void*> free_;
};

// The exceptions that are being handled, which the run-time library keeps by thread: each fiber has its own.
using Handled = std::array<std::byte, sizeof(void*) + sizeof(unsigned)>;

void exchange(Handled& handled) {
  void* const here = abi::__cxa_get_globals();
  Handled before;
  std::memcpy(before.data(), here, before.size());
  std::memcpy(here, handled.data(), handled.size());
  handled = before;
}

}  // namespace

struct Fiber::State {
  explicit State(std::function<void()> to_do) : work(std::move(to_do)), stack(Stacks::all().take()) {
#ifdef __SANITIZE_THREAD__
    own_fiber = __tsan_create_fiber(0);
#endif
  }
  ~State() {
#ifdef __SANITIZE_THREAD__
    __tsan_destroy_fiber(own_fiber);
#endif
    Stacks::all().give_back(stack);
  }
  State(const State&) = delete;
  State& operator=(const State&) = delete;

  static void enter();
  void arrived();
  void switch_to(const ucontext_t& to, ucontext_t& from, bool inwards);

  std::function<void()> work;
  void* stack;
  ucontext_t own = {}, caller = {};
  Handled handled = {};
  bool begun = false, over = false;
  const void* local = nullptr;
#ifdef __SANITIZE_ADDRESS__
  void *own_fake = nullptr, *caller_fake = nullptr;
  const void* caller_stack = nullptr;
  std::size_t caller_size = 0;
#endif
#ifdef __SANITIZE_THREAD__
  void *own_fiber = nullptr, *caller_fiber = nullptr;
#endif
  static thread_local State* running;
};

thread_local Fiber::State* Fiber::State::running = nullptr;

// Tells the sanitizers, where they watch, and switches.
void Fiber::State::switch_to(const ucontext_t& to, ucontext_t& from, [[maybe_unused]] bool inwards) {
#ifdef __SANITIZE_THREAD__
  if (inwards) caller_fiber = __tsan_get_current_fiber();
  __tsan_switch_to_fiber(inwards ? own_fiber : caller_fiber, 0);
#endif
#ifdef __SANITIZE_ADDRESS__
  if (inwards)
    __sanitizer_start_switch_fiber(&caller_fake, stack, stack_size);
  else
    __sanitizer_start_switch_fiber(over ? nullptr : &own_fake, caller_stack, caller_size);
#endif
  swapcontext(&from, &to);
#ifdef __SANITIZE_ADDRESS__
  if (inwards)
    __sanitizer_finish_switch_fiber(caller_fake, nullptr, nullptr);
  else
    arrived();
#endif
}

void Fiber::State::arrived() {
#ifdef __SANITIZE_ADDRESS__
  __sanitizer_finish_switch_fiber(own_fake, &caller_stack, &caller_size);
#endif
}

void Fiber::State::enter() {
  State& here = *running;
  here.arrived();
  here.work();
  here.over = true;
  here.switch_to(here.caller, here.own, false);
}

Fiber::Fiber(std::function<void()> work) : state_(std::make_unique<State>(std::move(work))) {}

Fiber::~Fiber() = default;

void Fiber::resume() {
  State& here = *state_;
  if (!here.begun) {
    here.begun = true;
    getcontext(&here.own);
    here.own.uc_stack.ss_sp = here.stack;
    here.own.uc_stack.ss_size = stack_size;
    here.own.uc_link = nullptr;
    makecontext(&here.own, &State::enter, 0);
  }
  State* const outer = std::exchange(State::running, &here);
  exchange(here.handled);
  here.switch_to(here.own, here.caller, true);
  exchange(here.handled);
  State::running = outer;
}

bool Fiber::over() const { return state_->over; }

const void*& Fiber::local() {
  static thread_local const void* outside = nullptr;
  return State::running != nullptr ? State::running->local : outside;
}

void Fiber::pause() {
  State& here = *State::running;
  here.switch_to(here.caller, here.own, false);
}

}  // namespace metastable::markov
