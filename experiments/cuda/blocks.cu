// Micro-benchmarks of one SM against the chip: how soon a block follows another, how fast blocks start, and what one,
// several and all SMs send (stores, loads past L1, atomics). Each SM gets one block of 1024 threads: shared memory keeps
// out a second. With -DMAIN a program that prints a row of CSV a result; without, kernels for measure-machine.
typedef unsigned int u32;
typedef unsigned long long u64;

static __device__ __forceinline__ u64 wall() { u64 t; asm volatile("mov.u64 %0, %%globaltimer;" : "=l"(t)); return t; }
static __device__ __forceinline__ u32 sm() { u32 s; asm volatile("mov.u32 %0, %%smid;" : "=r"(s)); return s; }

// A block that lasts some cycles; row a block: SM, first and last clock of it, wall clock at its start.
extern "C" __global__ void wait_cycles(long long cycles, long long* rows) {
  long long start = clock64();
  u64 begun = wall();
  while (clock64() - start < cycles) {}
  __syncthreads();
  if (threadIdx.x == 0 && rows) {
    long long* row = rows + 4ll * blockIdx.x;
    row[0] = sm(); row[1] = start; row[2] = clock64(); row[3] = begun;
  }
}

// What a warp touches in a round: words (128 bytes), quads (512 bytes), or a word in each of 32 random sectors.
enum Action { STORE_WORDS, STORE_QUADS, STORE_SCATTERED, LOAD_WORDS, LOAD_QUADS, LOAD_SCATTERED, ATOMIC_AWAITED, ATOMIC_BLIND,
              ATOMIC_WORDS_AWAITED, ATOMIC_WORDS_BLIND, ACTIONS };
template <int ACTION> static __device__ __forceinline__ void send(u32* a, u32 mask, int rounds, long long* cycles, u32* out) {
  u32 t = blockIdx.x * blockDim.x + threadIdx.x, x = t * 2654435761u + 1u, sum = 0, all = gridDim.x * blockDim.x;
  __syncthreads();
  long long start = clock64();
  #pragma unroll 8
  for (int r = 0; r < rounds; r++) {
    x = x * 1664525u + 1013904223u;
    u32 line = (t + r * all) & mask, sector = ((x >> 4) << 3) & mask, quad = ((t + r * all) << 2) & mask;
    if (ACTION == STORE_WORDS) a[line] = r;
    if (ACTION == STORE_QUADS) *(uint4*)(a + quad) = make_uint4(r, r, r, r);
    if (ACTION == STORE_SCATTERED) a[sector] = r;
    if (ACTION == LOAD_WORDS) sum += __ldcg(a + line);
    if (ACTION == LOAD_QUADS) { uint4 v = __ldcg((uint4*)(a + quad)); sum += v.x ^ v.y ^ v.z ^ v.w; }
    if (ACTION == LOAD_SCATTERED) sum += __ldcg(a + sector);
    if (ACTION == ATOMIC_AWAITED) sum ^= atomicAdd(a + sector, 1u);
    if (ACTION == ATOMIC_BLIND) asm volatile("red.global.add.u32 [%0], 1;" :: "l"(a + sector) : "memory");
    if (ACTION == ATOMIC_WORDS_AWAITED) sum ^= atomicAdd(a + line, 1u);
    if (ACTION == ATOMIC_WORDS_BLIND) asm volatile("red.global.add.u32 [%0], 1;" :: "l"(a + line) : "memory");
  }
  __threadfence();
  out[t] = sum;
  __syncthreads();
  if (threadIdx.x == 0) cycles[blockIdx.x] = clock64() - start;
}
#define SEND(NAME, ACTION) \
  extern "C" __global__ void NAME(u32* a, u32 m, int r, long long* c, u32* o) { send<ACTION>(a, m, r, c, o); }
SEND(store_words, STORE_WORDS) SEND(store_quads, STORE_QUADS) SEND(store_scattered, STORE_SCATTERED)
SEND(load_words, LOAD_WORDS) SEND(load_quads, LOAD_QUADS) SEND(load_scattered, LOAD_SCATTERED)
SEND(atomic_awaited, ATOMIC_AWAITED) SEND(atomic_blind, ATOMIC_BLIND)
SEND(atomic_words_awaited, ATOMIC_WORDS_AWAITED) SEND(atomic_words_blind, ATOMIC_WORDS_BLIND)

#ifdef MAIN
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <vector>
#define CHECK(e) do { cudaError_t r_ = (e); if (r_) { fprintf(stderr, "%s:%d %s\n", __FILE__, __LINE__, cudaGetErrorString(r_)); exit(1); } } while (0)
static const char* NAMES[ACTIONS] = {"store_words", "store_quads", "store_scattered", "load_words", "load_quads", "load_scattered",
  "atomic_awaited", "atomic_blind", "atomic_words_awaited", "atomic_words_blind"};
static void (*KERNELS[ACTIONS])(u32*, u32, int, long long*, u32*) = {store_words, store_quads, store_scattered, load_words, load_quads,
  load_scattered, atomic_awaited, atomic_blind, atomic_words_awaited, atomic_words_blind};
static const int LANE_BYTES[ACTIONS] = {4, 16, 32, 4, 16, 32, 32, 32, 4, 4};  // of sectors touched
static const int REPEATS = 7;
static int SMS, ONE_A_SM = 128 << 10;
static double median(std::vector<double> v) { std::sort(v.begin(), v.end()); return v[v.size() / 2]; }
static double low(std::vector<double> v) { std::sort(v.begin(), v.end()); return v[v.size() / 10]; }
static double high(std::vector<double> v) { std::sort(v.begin(), v.end()); return v[v.size() * 9 / 10]; }
static void row(const char* group, const char* name, int sms, const char* metric, double value) {
  printf("%s,%s,%d,%s,%.6g\n", group, name, sms, metric, value); fflush(stdout);
}

// Cycles from the end of a block to the start of the next on the same place.
static void follow(int block, int shared, long long cycles, const char* name) {
  int laps = 20, per = 1;
  CHECK(cudaOccupancyMaxActiveBlocksPerMultiprocessor(&per, wait_cycles, block, shared));
  int grid = SMS * per * laps;
  long long* rows; CHECK(cudaMallocManaged(&rows, 32ll * grid));
  for (int warm = 0; warm < 2; warm++) { wait_cycles<<<grid, block, shared>>>(cycles, rows); CHECK(cudaDeviceSynchronize()); }
  std::map<long long, std::vector<std::pair<long long, int>>> by;
  for (int i = 0; i < grid; i++) { by[rows[4 * i]].push_back({rows[4 * i + 1], +1}); by[rows[4 * i]].push_back({rows[4 * i + 2], -1}); }
  std::vector<double> gaps;  // each start is matched with the earliest end that no start has taken
  for (auto& each : by) {
    std::sort(each.second.begin(), each.second.end());
    std::vector<long long> ends; size_t taken = 0;
    for (auto& event : each.second) {
      if (event.second < 0) ends.push_back(event.first);
      else if (taken < ends.size()) gaps.push_back(double(event.first - ends[taken++]));
    }
  }
  row("follow", name, per, "median_cycles", median(gaps));
  row("follow", name, per, "low_cycles", low(gaps));
  row("follow", name, per, "high_cycles", high(gaps));
  double mean = 0; for (double g : gaps) mean += g;
  row("follow", name, per, "mean_cycles", mean / gaps.size());
  u64 first = ~0ull, last = 0;  // wall clock at the first and the last start of the first lap
  for (int i = 0; i < SMS * per; i++) { first = std::min(first, (u64)rows[4 * i + 3]); last = std::max(last, (u64)rows[4 * i + 3]); }
  row("follow", name, per, "first_lap_starts_ns", double(last - first));
  CHECK(cudaFree(rows));
}

// Microseconds of a kernel in a graph of 100: blocks that last some cycles.
static double in_graph(int grid, int block, int shared, long long cycles, int copies = 100) {
  cudaStream_t s; CHECK(cudaStreamCreate(&s));
  cudaGraph_t g; cudaGraphExec_t e;
  CHECK(cudaStreamBeginCapture(s, cudaStreamCaptureModeGlobal));
  for (int i = 0; i < copies; i++) wait_cycles<<<grid, block, shared, s>>>(cycles, (long long*)0);
  CHECK(cudaStreamEndCapture(s, &g));
  CHECK(cudaGraphInstantiate(&e, g, 0));
  cudaEvent_t a, b; CHECK(cudaEventCreate(&a)); CHECK(cudaEventCreate(&b));
  std::vector<double> times;
  for (int r = 0; r < REPEATS + 2; r++) {
    CHECK(cudaEventRecord(a, s)); CHECK(cudaGraphLaunch(e, s)); CHECK(cudaEventRecord(b, s)); CHECK(cudaEventSynchronize(b));
    float ms; CHECK(cudaEventElapsedTime(&ms, a, b));
    if (r >= 2) times.push_back(1e3 * ms / copies);
  }
  CHECK(cudaGraphExecDestroy(e)); CHECK(cudaGraphDestroy(g)); CHECK(cudaStreamDestroy(s));
  return median(times);
}

// Units a clock that n SMs send together.
static void rates(u32* a, u32 words, const char* where) {
  int rounds = 512;
  long long* cycles; u32* out; CHECK(cudaMallocManaged(&cycles, 8 * SMS)); CHECK(cudaMalloc(&out, 4ll * SMS * 1024));
  for (int action = 0; action < ACTIONS; action++)
    for (int n : {1, 2, 4, 8, 16, 33, 66, SMS}) {
      std::vector<double> found, slowest;
      for (int r = 0; r < REPEATS + 2; r++) {
        KERNELS[action]<<<n, 1024, ONE_A_SM>>>(a, words - 1, rounds, cycles, out);
        CHECK(cudaDeviceSynchronize());
        if (r < 2) continue;
        double most = 0, mean = 0;
        for (int i = 0; i < n; i++) { most = std::max(most, double(cycles[i])); mean += double(cycles[i]) / n; }
        found.push_back(1024.0 * rounds * n / mean);
        slowest.push_back(1024.0 * rounds * n / most);
      }
      char name[64]; snprintf(name, 64, "%s_%s", NAMES[action], where);
      row("send", name, n, "lanes_per_clk", median(found));
      row("send", name, n, "bytes_per_clk", median(found) * LANE_BYTES[action]);
      row("send", name, n, "bytes_per_clk_slowest", median(slowest) * LANE_BYTES[action]);
    }
  CHECK(cudaFree(cycles)); CHECK(cudaFree(out));
}

int main() {
  cudaDeviceProp p; CHECK(cudaGetDeviceProperties(&p, 0)); SMS = p.multiProcessorCount;
  CHECK(cudaFuncSetAttribute(wait_cycles, cudaFuncAttributeMaxDynamicSharedMemorySize, ONE_A_SM));
  for (auto kernel : KERNELS) CHECK(cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, ONE_A_SM));
  printf("group,case,sms,metric,value\n");
  fprintf(stderr, "%s, %d SMs\n", p.name, SMS);
  for (int block : {32, 128, 256, 512, 1024})
    for (int shared : {0, ONE_A_SM})
      for (long long cycles : {0, 1000, 5000, 20000}) {
        char name[64]; snprintf(name, 64, "block%d_shared%d_cycles%lld", block, shared, cycles);
        follow(block, shared, cycles, name);
      }
  for (int block : {32, 64, 128, 256, 512, 1024})
    for (int grid : {1, 33, 132, 264, 528, 1056, 2112, 4224, 16896, 135168, 1048576}) {
      char name[64]; snprintf(name, 64, "grid%d_block%d", grid, block);
      row("graph", name, SMS, "us_of_empty_blocks", in_graph(grid, block, 0, 0, grid > 20000 ? 3 : 100));
      if (grid <= 4224) row("graph", name, SMS, "us_of_4000_cycles", in_graph(grid, block, 0, 4000));
    }
  u32* a; u32 words = 4u << 20; CHECK(cudaMalloc(&a, 4ull * words)); CHECK(cudaMemset(a, 0, 4ull * words));
  rates(a, words, "16MiB");
  CHECK(cudaFree(a));
  words = 1u << 30; CHECK(cudaMalloc(&a, 4ull * words)); CHECK(cudaMemset(a, 0, 4ull * words));
  rates(a, words, "4GiB");
  return 0;
}
#endif
