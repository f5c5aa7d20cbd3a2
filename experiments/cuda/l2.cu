// Micro-benchmarks of L2: what it keeps of a buffer that all SMs use, and which of its units owns an address.
typedef unsigned int u32;
typedef unsigned long long u64;

extern "C" __global__ void fill(uint4* a, u64 n, u32 value) {  // 16 bytes a thread, in order
  u64 i = blockIdx.x * (u64)blockDim.x + threadIdx.x;
  if (i < n) a[i] = make_uint4(value, value + 1, value, (u32)i);
}
extern "C" __global__ void look(const uint4* a, u64 n, u32* out) {
  u64 i = blockIdx.x * (u64)blockDim.x + threadIdx.x;
  if (i >= n) return;
  uint4 v = a[i];
  if ((v.x ^ v.y ^ v.z ^ v.w) == 0x12345678u) *out = v.x;
}

// Records of `words` words of 8 bytes, a thread a record, of which the first `stored` words are written; a word of each.
extern "C" __global__ void records(u64* a, u32 n, u32 words, u32 stored, u64 value) {
  u32 i = blockIdx.x * blockDim.x + threadIdx.x;
  if (i >= n) return;
  for (u32 k = 0; k < stored; k++) a[(u64)i * words + k] = value + k;
}
extern "C" __global__ void look_records(const u64* a, u32 n, u32 words, u32* out) {
  u32 i = blockIdx.x * blockDim.x + threadIdx.x;
  if (i < n && a[(u64)i * words + words - 1] == 0x12345678u) *out = i;
}

// One SM adds at two words at a time, half of its lanes at each: it takes longer where one unit owns both.
static __device__ __forceinline__ int both(u32* a, u32 one, u32 other, int rounds) {
  u32* word = a + (threadIdx.x & 1 ? one : other);
  __syncthreads();
  long long start = clock64();
  for (int r = 0; r < rounds; r++) asm volatile("red.global.add.u32 [%0], 1;" :: "l"(word) : "memory");
  __threadfence();
  __syncthreads();
  return (int)(clock64() - start);
}
extern "C" __global__ void pair(u32* a, u32 one, u32 other, int rounds, int* cycles) {
  int taken = both(a, one, other, rounds);
  if (threadIdx.x == 0) *cycles = taken;
}
// Unit of each of n words, apart by a step: that of the first word found to be in its way, else a new one.
extern "C" __global__ void owners(u32* a, u32 step, int n, int rounds, int limit, int most, u32* firsts, int* units, int* owner) {
  __shared__ int together;
  int count = 0;
  for (int i = 0; i < n && count < most; i++) {
    int mine = -1;
    for (int j = 0; j < count && mine < 0; j++) {
      int taken = both(a, i * step, firsts[j], rounds);
      if (threadIdx.x == 0) together = taken > limit;
      __syncthreads();
      if (together) mine = j;
    }
    if (mine < 0) {
      mine = count++;
      if (threadIdx.x == 0) firsts[mine] = i * step;
      __threadfence();
      __syncthreads();
    }
    if (threadIdx.x == 0) owner[i] = mine;
  }
  if (threadIdx.x == 0) *units = count;
}
