// Micro-benchmarks for a machine description. Every kernel is small, fixed in shape, and timed from outside by events
// or from inside by the SM's clock; Python decides sizes and repeats (experiments/validation/measuring.py).
typedef unsigned int u32;
typedef unsigned long long u64;

// ---- one dependent chain (latency) or eight (throughput) of one operation; cycles of each block's first warp ----
template <class F, class T, int CHAINS> static __device__ __forceinline__ void chains(F step, T seed, int n, long long* cycles, T* out) {
  T v[CHAINS];
  #pragma unroll
  for (int c = 0; c < CHAINS; c++) v[c] = seed + (T)(threadIdx.x + c);
  __syncthreads();
  long long start = clock64();
  for (int i = 0; i < n; i++) {
    #pragma unroll
    for (int u = 0; u < 16; u++) {
      #pragma unroll
      for (int c = 0; c < CHAINS; c++) v[c] = step(v[c]);
    }
  }
  __syncthreads();
  long long end = clock64();
  T sum = v[0];
  #pragma unroll
  for (int c = 1; c < CHAINS; c++) sum += v[c];
  out[blockIdx.x * blockDim.x + threadIdx.x] = sum;
  if (threadIdx.x == 0) cycles[blockIdx.x] = end - start;
}
struct Ffma { __device__ float operator()(float x) const { asm volatile("fma.rn.f32 %0, %0, %0, %0;" : "+f"(x)); return x; } };
struct Logic { __device__ u32 operator()(u32 x) const { asm volatile("lop3.b32 %0, %0, %0, 0x5bd1e995, 0x96;" : "+r"(x)); return x; } };
struct Imad { __device__ u32 operator()(u32 x) const { asm volatile("mad.lo.u32 %0, %0, %0, %0;" : "+r"(x)); return x; } };
struct Rsqrt { __device__ float operator()(float x) const { asm volatile("rsqrt.approx.f32 %0, %0;" : "+f"(x)); return x; } };
#define CHAIN(NAME, F, T) \
  extern "C" __global__ void lat_##NAME(int n, long long* c, T* o) { chains<F, T, 1>(F(), (T)3, n, c, o); } \
  extern "C" __global__ void thr_##NAME(int n, long long* c, T* o) { chains<F, T, 8>(F(), (T)3, n, c, o); }
CHAIN(fp32, Ffma, float)
CHAIN(int32, Logic, u32)
CHAIN(mul32, Imad, u32)
CHAIN(sfu, Rsqrt, float)

// ---- latencies: chains of loads, each of which fetches the address of the next; barriers; awaited atomics ----
template <int L1> static __device__ __forceinline__ void chase(int n, u64* place, long long* cycles) {
  u64 at = *place;  // where the last walk ended
  long long start = clock64();
  for (int i = 0; i < n; i++)
    if (L1) asm volatile("ld.global.ca.u64 %0, [%0];" : "+l"(at));
    else asm volatile("ld.global.cg.u64 %0, [%0];" : "+l"(at));
  *place = at;
  *cycles = clock64() - start;
}
extern "C" __global__ void chase_l1(int n, u64* place, long long* cycles) { chase<1>(n, place, cycles); chase<1>(n, place, cycles); }
extern "C" __global__ void chase_l2(int n, u64* place, long long* cycles) { chase<0>(n, place, cycles); }
extern "C" __global__ void chase_shared(int n, long long* cycles, u32* out) {
  __shared__ u32 next[1024];
  u32 base = (u32)__cvta_generic_to_shared(next);
  for (int i = threadIdx.x; i < 1024; i += blockDim.x) next[i] = base + 4 * ((i + 33) & 1023);
  __syncthreads();
  u32 at = base + 4 * threadIdx.x;
  long long start = clock64();
  for (int i = 0; i < n; i++) asm volatile("ld.shared.u32 %0, [%0];" : "+r"(at));
  out[threadIdx.x] = at;
  cycles[0] = clock64() - start;
}
extern "C" __global__ void chase_atomic(u32* counters, u32 apart, int places, int n, long long* cycles, u32* out) {
  u32 zero = (u32)(n >> 31);  // nothing is added, so that the chain goes on, and the compiler can't know
  for (int p = 0; p < places; p++) {
    long long start = clock64();
    for (int i = 0; i < n; i++) zero = atomicAdd(counters + (u64)p * apart + zero, zero);
    cycles[p] = clock64() - start + zero;
  }
  out[0] = zero;
}
extern "C" __global__ void barriers(int n, long long* cycles) {
  __syncthreads();
  long long start = clock64();
  for (int i = 0; i < n; i++) __syncthreads();
  if (threadIdx.x == 0) cycles[blockIdx.x] = clock64() - start;
}

// ---- bandwidths ----
extern "C" __global__ void read_all(const float4* a, u64 mask, int rounds, float* out) {  // round after round, wrapping
  float sum = 0;
  u64 step = (u64)gridDim.x * blockDim.x, at = blockIdx.x * (u64)blockDim.x + threadIdx.x;
  for (int r = 0; r < rounds; r++, at += 8 * step) {
    float4 v[8];
    #pragma unroll
    for (int k = 0; k < 8; k++) asm volatile("ld.global.cg.v4.f32 {%0,%1,%2,%3}, [%4];"
      : "=f"(v[k].x), "=f"(v[k].y), "=f"(v[k].z), "=f"(v[k].w) : "l"(a + (at + k * step & mask)));
    #pragma unroll
    for (int k = 0; k < 8; k++) sum += v[k].x + v[k].y + v[k].z + v[k].w;
  }
  if (sum == 12345.678f) *out = sum;
}
extern "C" __global__ void read_l1(const float4* a, int rounds, long long* cycles, float* out) {
  const float4* p = a + (u64)blockIdx.x * 1024;
  float sum = 0;
  __syncthreads();
  long long start = clock64();
  for (int r = 0; r < rounds; r++) {
    float4 v[8];
    #pragma unroll
    for (int k = 0; k < 8; k++) asm volatile("ld.global.ca.v4.f32 {%0,%1,%2,%3}, [%4];"
      : "=f"(v[k].x), "=f"(v[k].y), "=f"(v[k].z), "=f"(v[k].w) : "l"(p + (threadIdx.x + r * 32 & 511) + k * 64));
    #pragma unroll
    for (int k = 0; k < 8; k++) sum += v[k].x;
  }
  __syncthreads();
  if (threadIdx.x == 0) cycles[blockIdx.x] = clock64() - start;
  if (sum == 12345.678f) *out = sum;
}
extern "C" __global__ void banks(int stride, int rounds, long long* cycles, u32* out) {
  __shared__ u32 words[4096];
  for (int i = threadIdx.x; i < 4096; i += blockDim.x) words[i] = i;
  u32 sum = 0, at = (threadIdx.x & 31) * stride;
  __syncthreads();
  long long start = clock64();
  for (int r = 0; r < rounds; r++)
    #pragma unroll
    for (int k = 0; k < 8; k++) sum += ((volatile u32*)words)[(at + k * 32) & 4095];
  __syncthreads();
  if (threadIdx.x == 0) cycles[blockIdx.x] = clock64() - start;
  out[blockIdx.x * blockDim.x + threadIdx.x] = sum;
}

// ---- atomics: lane address = (warp * warp_words + (lane % spread) * lane_words) % words, moved on by hop words a round ----
template <int RETURN> static __device__ __forceinline__ void pattern(u32* a, u32 spread, u32 lane_words, u32 warp_words, u32 mask, u32 hop, int rounds, u32* out) {
  u32 t = blockIdx.x * blockDim.x + threadIdx.x, lane = threadIdx.x & 31, sum = 0;
  u32 at = (t >> 5) * warp_words + (lane % spread) * lane_words;
  for (int r = 0; r < rounds; r++) {
    u32* p = a + ((at + r * hop) & mask);
    if (RETURN) sum ^= atomicAdd(p, 1u);
    else asm volatile("red.global.add.u32 [%0], 1;" :: "l"(p) : "memory");
  }
  if (RETURN) out[t] = sum;
}
extern "C" __global__ void atomics_awaited(u32* a, u32 s, u32 l, u32 w, u32 m, u32 h, int r, u32* o) { pattern<1>(a, s, l, w, m, h, r, o); }
extern "C" __global__ void atomics_blind(u32* a, u32 s, u32 l, u32 w, u32 m, u32 h, int r, u32* o) { pattern<0>(a, s, l, w, m, h, r, o); }
extern "C" __global__ void atomics_random(u32* a, u32 sectors, int awaited, int rounds, u32* out) {
  u32 t = blockIdx.x * blockDim.x + threadIdx.x, x = t * 2654435761u + 1u, sum = 0;
  for (int r = 0; r < rounds; r++) {
    x = x * 1664525u + 1013904223u;
    u32* p = a + (u64)(__umulhi(x, sectors)) * 8;
    if (awaited) sum ^= atomicAdd(p, 1u);
    else asm volatile("red.global.add.u32 [%0], 1;" :: "l"(p) : "memory");
  }
  if (awaited) out[t] = sum;
}

// ---- launches and the clock ----
extern "C" __global__ void empty() {}
extern "C" __global__ void burn(int n, long long* cycles, float* out) {
  float x = threadIdx.x;
  long long start = clock64();
  for (int i = 0; i < n; i++) x = fmaf(x, 1.0001f, 0.5f);
  out[blockIdx.x * blockDim.x + threadIdx.x] = x;
  if (threadIdx.x == 0) cycles[blockIdx.x] = clock64() - start;
}
