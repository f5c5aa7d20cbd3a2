// Micro-benchmarks of loads while memory is busy: nvcc -arch=sm_90 -O3 -std=c++17; prints rows of loaded_latency.csv.
//   steady: warps of all SMs that each wait for a load before the next; cycles a load
//   chase:  one lane alone on its SM does so while warps of the other SMs load or store
//   waves:  a grid of blocks of a few such loads each; from the first start of a block to the last end of one
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <vector>
typedef unsigned int u32;
typedef unsigned long long u64;
#define CHECK(e) do { cudaError_t r_ = (e); if (r_) { fprintf(stderr, "%d %s\n", __LINE__, cudaGetErrorString(r_)); exit(1); } } while (0)

// What a warp touches in a step: a random sector a lane, 128 or 512 bytes at a random place.
enum Pattern { SECTOR, LINE, QUAD, STORE_SECTOR, STORE_QUAD };
static const char* NAMES[] = {"sector", "line", "quad", "store_sector", "store_quad"};
static const int BYTES[] = {1024, 128, 512, 1024, 512};
static const u64 IN_L2 = 4u << 20, IN_DRAM = 1u << 28;  // words of a buffer of zeros

static __device__ __forceinline__ u64 wall() { u64 t; asm volatile("mov.u64 %0, %%globaltimer;" : "=l"(t)); return t; }
static __device__ __forceinline__ u32 mixed(u32 x) {
  x ^= x >> 16; x *= 0x7feb352du; x ^= x >> 15; x *= 0x846ca68bu; return x ^ x >> 16;
}
template <int P> static __device__ __forceinline__ u32 next(u32* a, u64 mask, u32 x) {  // it depends on what is loaded
  u32 lane = threadIdx.x & 31, found = 0;
  u64 sector = ((u64)mixed(x) << 3) & mask, line = ((u64)mixed(x) << 5) & mask, quad = (((u64)mixed(x) << 7) & mask) | lane * 4;
  if (P == SECTOR) found = __ldcg(a + sector);
  if (P == LINE) found = __ldcg(a + (line | lane));
  if (P == QUAD) { uint4 v = __ldcg((uint4*)(a + quad)); found = v.x | v.y | v.z | v.w; }
  if (P == STORE_SECTOR) a[sector] = 0;
  if (P == STORE_QUAD) *(uint4*)(a + quad) = make_uint4(0, 0, 0, 0);
  return x * 1664525u + 1013904223u + found;
}
template <int P> static __device__ __forceinline__ u32 first() {
  u32 t = blockIdx.x * blockDim.x + threadIdx.x;
  return mixed((P == SECTOR || P == STORE_SECTOR ? t : t >> 5) * 2654435761u + 12345u);
}
template <int P> __global__ void steady(u32* a, u64 mask, int rounds, float* cycles, u32* out) {
  u32 x = first<P>();
  __syncthreads();
  long long start = clock64();
  for (int r = 0; r < rounds; r++) x = next<P>(a, mask, x);
  if ((threadIdx.x & 31) == 0) cycles[(blockIdx.x * blockDim.x + threadIdx.x) >> 5] = (float)(clock64() - start) / rounds;
  if (x == 77) *out = x;
}
template <int P> __global__ void chase(u32* near, u32* a, u64 mask, int rounds, int warps, volatile int* done, float* cycles, u64* steps, u32* out) {
  u32 x = first<P>();
  if (blockIdx.x == 0) {
    if (threadIdx.x) return;
    for (int r = 0; r < 600; r++) x = next<SECTOR>(near, mask, x);
    long long start = clock64();
    for (int r = 0; r < rounds; r++) x = next<SECTOR>(near, mask, x);
    *cycles = (float)(clock64() - start) / rounds;
    *done = 1;
    __threadfence();
  } else if ((threadIdx.x >> 5) < warps) {
    u64 n = 0;
    long long start = clock64();
    do {
      for (int r = 0; r < 8; r++) x = next<P>(a, mask, x);
      n += 8;
    } while (!*done);
    if ((threadIdx.x & 31) == 0) atomicAdd(steps, (u64)(1e6 * n / (double)(clock64() - start)));
  }
  if (x == 77) *out = x;
}
template <int P> __global__ void waves(u32* a, u64 mask, int steps, u64* begin, u64* end, u32* out) {
  if (threadIdx.x == 0) begin[blockIdx.x] = wall();
  u32 x = first<P>();
  for (int r = 0; r < steps; r++) x = next<P>(a, mask, x);
  if (x == 77) *out = x;
  __syncthreads();
  if (threadIdx.x == 0) end[blockIdx.x] = wall();
}
static u32 *a, *out;
static float* cycles;
static u64 *begin, *end, *steps_made;
static int* done;
template <class T> static std::vector<T> host(T* from, int n) {
  std::vector<T> to(n);
  CHECK(cudaMemcpy(to.data(), from, n * sizeof(T), cudaMemcpyDeviceToHost));
  return to;
}
template <int P> static void steady_rows(const char* where, u64 words) {
  for (int warps : {1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64}) {
    int block = warps <= 32 ? 32 * warps : 16 * warps, grid = warps <= 32 ? 132 : 264;
    for (int twice = 0; twice < 2; twice++) steady<P><<<grid, block>>>(a, words - 1, words > IN_L2 ? 120 : 400, cycles, out);
    CHECK(cudaDeviceSynchronize());
    double mean = 0;
    for (float c : host(cycles, grid * block / 32)) mean += c / (grid * block / 32);
    printf("steady,%s,%s,,%d,cycles,%.1f\n", where, NAMES[P], warps, mean);
    printf("steady,%s,%s,,%d,bytes_per_clock,%.1f\n", where, NAMES[P], warps, 132.0 * warps * BYTES[P] / mean);
  }
}
template <int P> static void chase_rows(const char* where, u64 words) {
  int room = 200000;  // of shared memory: a block an SM
  CHECK(cudaFuncSetAttribute(chase<P>, cudaFuncAttributeMaxDynamicSharedMemorySize, room));
  for (int warps : {0, 1, 2, 4, 8, 12, 16, 24, 32}) {
    CHECK(cudaMemset(done, 0, 4)); CHECK(cudaMemset(steps_made, 0, 8));
    u32* other = a + (words > IN_L2 ? IN_DRAM : 0);
    chase<P><<<132, 1024, room>>>(a, other, words - 1, words > IN_L2 ? 1500 : 2500, warps, done, cycles, steps_made, out);
    CHECK(cudaDeviceSynchronize());
    printf("chase,%s,%s,,%d,cycles,%.1f\n", where, NAMES[P], warps, host(cycles, 1)[0]);
    printf("chase,%s,%s,,%d,bytes_per_clock,%.1f\n", where, NAMES[P], warps, host(steps_made, 1)[0] * 1e-6 * BYTES[P]);
  }
}
template <int P> static void wave_rows(int block, int shared) {
  int places;
  CHECK(cudaFuncSetAttribute(waves<P>, cudaFuncAttributeMaxDynamicSharedMemorySize, 200000));
  CHECK(cudaOccupancyMaxActiveBlocksPerMultiprocessor(&places, waves<P>, block, shared));
  for (int steps : {1, 2, 4, 8, 16})
    for (double rounds : {0.25, 0.5, 1.0, 2.0, 4.0, 8.0}) {
      int grid = rounds * 132 * places;
      std::vector<double> us;
      for (int k = 0; k < 9; k++) {
        waves<P><<<grid, block, shared>>>(a, IN_L2 - 1, steps, begin, end, out);
        auto b = host(begin, grid), e = host(end, grid);
        us.push_back(1e-3 * (*std::max_element(e.begin(), e.end()) - *std::min_element(b.begin(), b.end())));
      }
      std::sort(us.begin(), us.end());
      printf("waves,%d threads; %d an SM,%s,%d,%d,us,%.2f\n", block, places, NAMES[P], steps, grid, us[4]);
    }
}
static void warm(u64 words, int times) {
  for (int k = 0; k < times; k++) steady<QUAD><<<264, 1024>>>(a, words - 1, 400, cycles, out);
  CHECK(cudaDeviceSynchronize());
}
int main() {
  CHECK(cudaMalloc(&a, 8 * IN_DRAM)); CHECK(cudaMemset(a, 0, 8 * IN_DRAM)); CHECK(cudaMalloc(&out, 64)); CHECK(cudaMalloc(&cycles, 4 << 20));
  CHECK(cudaMalloc(&begin, 8 << 20)); CHECK(cudaMalloc(&end, 8 << 20)); CHECK(cudaMalloc(&steps_made, 64)); CHECK(cudaMalloc(&done, 64));
  printf("group,case,pattern,steps,count,metric,value\n");
  warm(IN_DRAM, 60); warm(IN_L2, 3);
  steady_rows<SECTOR>("l2", IN_L2); steady_rows<LINE>("l2", IN_L2); steady_rows<QUAD>("l2", IN_L2);
  steady_rows<SECTOR>("dram", IN_DRAM); steady_rows<LINE>("dram", IN_DRAM); steady_rows<QUAD>("dram", IN_DRAM);
  warm(IN_L2, 3);
  chase_rows<SECTOR>("l2", IN_L2); chase_rows<QUAD>("l2", IN_L2); chase_rows<STORE_SECTOR>("l2", IN_L2); chase_rows<STORE_QUAD>("l2", IN_L2);
  chase_rows<QUAD>("dram", IN_DRAM); chase_rows<SECTOR>("dram", IN_DRAM); chase_rows<STORE_QUAD>("dram", IN_DRAM);
  warm(IN_L2, 3);
  wave_rows<SECTOR>(256, 0); wave_rows<QUAD>(256, 0); wave_rows<SECTOR>(128, 56000); wave_rows<LINE>(256, 0);
}
