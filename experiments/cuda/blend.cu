// The programs of the ROP of simulator/stages/laine2011/blend_programs.py in CUDA, in a conflict loop as CudaRaster 1.1
// has it: every lane writes its number to its pixel, and the one that finds its own there runs. Words of pixel p of the
// tile lie at word[64 * i + p]. Which lane a GPU lets win is probed by the original; only the code is read here.
typedef unsigned int u32;
typedef unsigned long long u64;
typedef volatile u32* Words;
extern __shared__ volatile u32 word[];

static __device__ __forceinline__ u32 mixed(u32 s, u32 d, u32 a) {
  return ((s * a + d * (255 - a)) * 0x010101 + 0x800000) >> 24;
}
static __device__ __forceinline__ u32 over(u32 s, u32 d) {
  u32 a = s >> 24;
  return mixed(s & 255, d & 255, a) | mixed((s >> 8) & 255, (d >> 8) & 255, a) << 8 |
         mixed((s >> 16) & 255, (d >> 16) & 255, a) << 16 | mixed(a, d >> 24, a) << 24;
}
static __device__ __forceinline__ u32 product(u32 a, u32 b) { return (a * b * 0x010101 + 0x800000) >> 24; }
static __device__ __forceinline__ u32 random_word(u32 w) {
  w = (w ^ (w >> 16)) * 0x2C1B3C6Du;
  w = (w ^ (w >> 15)) * 0x297A2D39u;
  return w ^ (w >> 15);
}

struct Blend {
  static __device__ u32 left(u32) { return 0; }  // what the lane keeps of its fragment
};

struct Over : Blend {
  static __device__ void run(Words w, int p, u32 c, u32, u32, int) { w[p] = over(c, w[p]); }
};
struct Additive : Blend {
  static __device__ void run(Words w, int p, u32 c, u32, u32, int) {
    u32 d = w[p], a = c >> 24, r = 0;
#pragma unroll
    for (int i = 0; i < 32; i += 8) r |= min(product((c >> i) & 255, a) + ((d >> i) & 255), 255u) << i;
    w[p] = r;
  }
};
struct Max : Blend {
  static __device__ void run(Words w, int p, u32 c, u32, u32, int) { w[p] = __vmaxu4(c, w[p]); }
};
struct Multiply : Blend {
  static __device__ void run(Words w, int p, u32 c, u32, u32, int) {
    u32 d = w[p], r = 0;
#pragma unroll
    for (int i = 0; i < 32; i += 8) r |= product((c >> i) & 255, (d >> i) & 255) << i;
    w[p] = r;
  }
};
struct Nearest : Blend {
  static __device__ void run(Words w, int p, u32 c, u32 z, u32, int) {
    if (z < w[64 + p]) { w[64 + p] = z; w[p] = c; }
  }
};
struct KBuffer : Blend {
  static __device__ void run(Words w, int p, u32 c, u32 z, u32, int n) {
#pragma unroll 1
    for (int i = 1; i < n; i += 2) {
      u32 old_z = w[64 * i + 64 + p], old_c = w[64 * i + p];
      bool nearer = z <= old_z;
      w[64 * i + p] = nearer ? c : old_c;
      w[64 * i + 64 + p] = nearer ? z : old_z;
      c = nearer ? old_c : c;
      z = nearer ? old_z : z;
    }
    if (z != ~0u) w[p] = over(c, w[p]);
  }
};
struct Stochastic : Blend {
  static __device__ void run(Words w, int p, u32 c, u32 z, u32 key, int n) {
#pragma unroll 1
    for (int i = 0; i < n; i += 2) {
      key = random_word(key + i);
      if ((key & 0xffffff) * u64(255) < u64(c >> 24) << 24 && z < w[64 * i + 64 + p]) {
        w[64 * i + 64 + p] = z;
        w[64 * i + p] = c;
      }
    }
  }
};

struct Linked {  // the head of the pixel's list: the node's link is what was there
  static __device__ void run(Words w, int p, u32& c, u32 node, u32, int) { c = w[p]; w[p] = node; }
  static __device__ u32 left(u32 c) { return c; }
};
struct Fixed {  // how many there are: the fragment's place
  static __device__ void run(Words w, int p, u32& c, u32, u32, int) { c = w[p]; w[p] = c + 1; }
  static __device__ u32 left(u32 c) { return c; }
};

template <class Program> __global__ void rop(const uint4* fragments, u32* out, int n) {
  __shared__ volatile u32 owner[64];
  uint4 f = fragments[threadIdx.x];
  int p = f.x;
  bool live = f.w != 0;
#pragma unroll 1
  while (__any_sync(~0u, live)) {
    if (live) {
      owner[p] = threadIdx.x;
      __syncwarp(__activemask());
      if (owner[p] == threadIdx.x) {
        Program::run(word, p, f.y, f.z, f.w, n);
        live = false;
      }
    }
    __syncwarp();
  }
  out[threadIdx.x] = word[threadIdx.x] + Program::left(f.y);
}
template __global__ void rop<Over>(const uint4*, u32*, int);
template __global__ void rop<Additive>(const uint4*, u32*, int);
template __global__ void rop<Max>(const uint4*, u32*, int);
template __global__ void rop<Multiply>(const uint4*, u32*, int);
template __global__ void rop<Nearest>(const uint4*, u32*, int);
template __global__ void rop<KBuffer>(const uint4*, u32*, int);
template __global__ void rop<Stochastic>(const uint4*, u32*, int);
template __global__ void rop<Linked>(const uint4*, u32*, int);
template __global__ void rop<Fixed>(const uint4*, u32*, int);

extern "C" __global__ void resolve_k_buffer(u32* out, int n) {
  int p = threadIdx.x;
  u32 r = word[p];
#pragma unroll 1
  for (int i = n - 2; i > 0; i -= 2)
    if (word[64 * i + 64 + p] != ~0u) r = over(word[64 * i + p], r);
  out[p] = r;
}
extern "C" __global__ void resolve_stochastic(u32* out, int n) {
  int p = threadIdx.x;
  u32 even = 0, odd = 0;
#pragma unroll 1
  for (int i = 0; i < n; i += 2) {
    u32 c = word[64 * i + p];
    even += c & 0xff00ff;
    odd += (c >> 8) & 0xff00ff;
  }
  float s = 1.0f / (n / 2);
  out[p] = (u32)((even & 0xffff) * s + 0.5f) | (u32)((even >> 16) * s + 0.5f) << 16 |
           (u32)((odd & 0xffff) * s + 0.5f) << 8 | (u32)((odd >> 16) * s + 0.5f) << 24;
}

static const int LONGEST = 64;  // fragments that local memory has room for
template <bool fixed> __global__ void resolve_lists(const u32* heads, const uint2* nodes, const u32* links, u32* out,
                                                    int room, int row) {
  int at = blockIdx.x * blockDim.x + threadIdx.x, n = 0;
  u32 head = heads[at], here = fixed ? (at >> 6) * room * 64 + (at & 63) : head;
  uint2 kept[LONGEST];
#pragma unroll 1
  while (fixed ? n < (int)head : here != ~0u) {
    uint2 f = nodes[here];
    int i = n++;
    here = fixed ? here + 64 : links[here];
#pragma unroll 1
    for (; i > 0 && (fixed ? kept[i - 1].y < f.y : kept[i - 1].y <= f.y); i--) kept[i] = kept[i - 1];
    kept[i] = f;
  }
  float r = 0, g = 0, b = 0, a = 0;
#pragma unroll 1
  for (int i = 0; i < n; i++) {
    u32 c = kept[i].x;
    float alpha = (c >> 24) * (1.0f / 255);
    r += alpha * ((c & 255) - r);
    g += alpha * (((c >> 8) & 255) - g);
    b += alpha * (((c >> 16) & 255) - b);
    a += alpha * ((c >> 24) - a);
  }
  out[(at >> 6) * row + (at & 63)] = (u32)(r + 0.5f) | (u32)(g + 0.5f) << 8 | (u32)(b + 0.5f) << 16 | (u32)(a + 0.5f) << 24;
}
template __global__ void resolve_lists<false>(const u32*, const uint2*, const u32*, u32*, int, int);
template __global__ void resolve_lists<true>(const u32*, const uint2*, const u32*, u32*, int, int);
