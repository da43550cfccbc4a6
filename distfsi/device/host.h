// CUDA C on the host: the words of the language that a host compiler lacks, and launches that run a grid's threads one
// after the other. Threads of a block are fibres where a kernel has barriers. The order may be reversed, as no kernel
// may depend on it.

#include <cmath>
#include <cstring>
#include <functional>
#include <utility>
#include <vector>
#include <ucontext.h>

#define __device__
#define __global__
#define __forceinline__ inline
#define __launch_bounds__(...)
#define __shared__ static

namespace host {

struct Dim { int x = 1, y = 1, z = 1; };
struct Fibre { ucontext_t context; bool done; int count; std::vector<char> stack = std::vector<char>(1 << 18); };

static Dim block, thread, blocks, threads;
static ucontext_t scheduler;
static std::vector<Fibre> fibres;
static int current;
static int sums[2];  // of a barrier that counts, by turns
static std::function<void()> body;
static std::vector<char> shared_memory;

static void enter()
{
    body();
    fibres[current].done = true;
    swapcontext(&fibres[current].context, &scheduler);
}

static void pause()
{
    const int me = current;
    swapcontext(&fibres[me].context, &scheduler);
}

// Runs all fibres from barrier to barrier.
static void run_block(int count, bool reversed)
{
    if ((int)fibres.size() < count) fibres.resize(count);
    for (int t = 0; t < count; t++) {
        Fibre &fibre = fibres[t];
        fibre.done = false;
        fibre.count = 0;
        getcontext(&fibre.context);
        fibre.context.uc_stack.ss_sp = fibre.stack.data();
        fibre.context.uc_stack.ss_size = fibre.stack.size();
        fibre.context.uc_link = nullptr;
        makecontext(&fibre.context, enter, 0);
    }
    sums[0] = sums[1] = 0;
    for (bool live = true; live;) {
        live = false;
        for (int n = 0; n < count; n++) {
            current = reversed ? count - 1 - n : n;
            if (fibres[current].done) continue;
            thread.x = current;
            swapcontext(&scheduler, &fibres[current].context);
            live = live || !fibres[current].done;
        }
    }
}

template <class... A, size_t... I>
static void launch(void (*kernel)(A...), void **arguments, int grid, int size, bool barriers, bool reversed,
                   std::index_sequence<I...>)
{
    body = [=] { kernel(*(A *)arguments[I]...); };
    blocks.x = grid;
    threads.x = size;
    for (int b = 0; b < grid; b++) {
        block.x = reversed ? grid - 1 - b : b;
        if (barriers) {
            run_block(size, reversed);
        } else {
            for (int t = 0; t < size; t++) {
                thread.x = reversed ? size - 1 - t : t;
                body();
            }
        }
    }
}

template <class... A>
static void launch(void (*kernel)(A...), void **arguments, int grid, int size, int shared, bool barriers, bool reversed)
{
    // what a block finds in shared memory is not what it left there
    if ((int)shared_memory.size() < shared) shared_memory.resize(shared);
    memset(shared_memory.data(), 0xff, shared_memory.size());
    launch(kernel, arguments, grid, size, barriers, reversed, std::index_sequence_for<A...>());
}

}  // namespace host

#define threadIdx host::thread
#define blockIdx host::block
#define blockDim host::threads
#define gridDim host::blocks
#define DYNAMIC_SHARED(name) char *name = host::shared_memory.data()

static inline void __syncthreads() { host::pause(); }

// The number of threads for which `predicate` holds; two barriers in one, as the next count must wait for all readers.
static inline int __syncthreads_count(int predicate)
{
    int &turn = host::fibres[host::current].count;
    int &sum = host::sums[turn];
    turn = 1 - turn;
    sum += predicate != 0;
    host::pause();
    const int result = sum;
    host::pause();
    sum = 0;
    return result;
}

static inline unsigned long long atomicAdd(unsigned long long *at, unsigned long long value)
{
    const unsigned long long before = *at;
    *at += value;
    return before;
}

static inline long long __double_as_longlong(double x) { long long bits; memcpy(&bits, &x, 8); return bits; }
static inline double __longlong_as_double(long long bits) { double x; memcpy(&x, &bits, 8); return x; }
static inline int __float_as_int(float x) { int bits; memcpy(&bits, &x, 4); return bits; }
static inline float __int_as_float(int bits) { float x; memcpy(&x, &bits, 4); return x; }

#define HOST_LAUNCH(NAME) \
    extern "C" void launch_##NAME(void **arguments, int grid, int size, int shared, int barriers, int reversed) \
    { \
        host::launch(distfsi::NAME##_kernel, arguments, grid, size, shared, barriers, reversed); \
    }
