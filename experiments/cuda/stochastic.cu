// Rasters of moving, defocused triangles and of lines of sight, as simulator/stages/stochastic/sample_raster.py describes
// them: a block a tile, a thread a pixel, samples and what is nearest to them in shared memory. Products of an edge are
// not contracted with its difference: its two triangles would round it differently.
typedef unsigned int u32;
typedef unsigned long long u64;
struct Sample { float t, ax, ay, bx, by; };  // time; aperture * lens - place, aperture * lens * focus
static __device__ __forceinline__ float edge(float xi, float yi, float xj, float yj) {
  return __fsub_rn(__fmul_rn(xi, yj), __fmul_rn(xj, yi));
}
static __device__ __noinline__ bool owns(float xi, float yi, float wi, float xj, float yj, float wj, bool positive) {
  float right = wj * yi - wi * yj, down = wi * xj - wj * xi;
  float first = right != 0.f ? right : down;
  return positive ? first > 0.f : first < 0.f;
}
static __device__ __forceinline__ void keep(u64* best, float depth, u32 p) {
  u64 now = (u64)__float_as_uint(depth) << 32 | p;
  if (depth >= 0.f && now < *best) *best = now;
}

extern "C" __global__ void __launch_bounds__(256) sample_raster(const uint2* __restrict__ entries,
    const u32* __restrict__ starts, const float4* __restrict__ triangles, const float4* __restrict__ pattern,
    const unsigned char* __restrict__ greys, int tile, int columns, int width, int height, int spp, float aperture,
    float focus, u32* image) {
  extern __shared__ u64 best[];
  int threads = tile * tile, me = threadIdx.x;
  Sample* samples = (Sample*)(best + threads * spp);
  int x = (blockIdx.x % columns) * tile + me % tile, y = (blockIdx.x / columns) * tile + me / tile;
  for (int s = 0; s < spp; s++) {
    float4 at = pattern[((y & 31) * 32 + (x & 31)) * spp + s];  // time, u, v, place in 16 bits each
    float u = aperture * at.y, v = aperture * at.z;
    u32 place = __float_as_uint(at.w);
    float px = x + (place & 0xffff) * (1.f / 4096), py = y + (place >> 16) * (1.f / 4096);
    samples[s * threads + me] = {at.x, u - px, v - py, u * focus, v * focus};
    best[s * threads + me] = ~0ull;
  }
  u32 last = starts[blockIdx.x + 1];
  for (u32 i = starts[blockIdx.x]; i < last; i++) {
    uint2 entry = entries[i];
    const float4* at = triangles + 6 * (size_t)entry.x;
    float4 p[3] = {at[0], at[1], at[2]}, d[3] = {at[3], at[4], at[5]};
    for (u32 mask = entry.y; mask; mask &= mask - 1) {
      int s = (__ffs(mask) - 1) * threads + me;
      Sample o = samples[s];
      float X[3], Y[3], W[3];
      #pragma unroll
      for (int k = 0; k < 3; k++) {
        W[k] = p[k].w + o.t * d[k].w;
        X[k] = (p[k].x + o.t * d[k].x - o.bx) + W[k] * o.ax;
        Y[k] = (p[k].y + o.t * d[k].y - o.by) + W[k] * o.ay;
      }
      float a = edge(X[1], Y[1], X[2], Y[2]), b = edge(X[2], Y[2], X[0], Y[0]), c = edge(X[0], Y[0], X[1], Y[1]);
      float low = fminf(fminf(a, b), c), high = fmaxf(fmaxf(a, b), c);
      if (low < 0.f && high > 0.f || low == high && low == 0.f) continue;
      if (low == 0.f || high == 0.f) {
        bool up = high > 0.f;
        if (a == 0.f && !owns(X[1], Y[1], W[1], X[2], Y[2], W[2], up)) continue;
        if (b == 0.f && !owns(X[2], Y[2], W[2], X[0], Y[0], W[0], up)) continue;
        if (c == 0.f && !owns(X[0], Y[0], W[0], X[1], Y[1], W[1], up)) continue;
      }
      float z = a * (p[0].z + o.t * d[0].z) + b * (p[1].z + o.t * d[1].z) + c * (p[2].z + o.t * d[2].z);
      float w = a * W[0] + b * W[1] + c * W[2];
      if (w > 0.f != high > 0.f || w == 0.f || fabsf(z) > fabsf(w)) continue;
      keep(best + s, .5f + .5f * __fdividef(z, w), entry.x);
    }
  }
  u32 sum = 0;
  for (int s = 0; s < spp; s++) {
    u64 found = best[s * threads + me];
    sum += found == ~0ull ? 255 : greys[(u32)found];
  }
  if (x < width && y < height) image[y * width + x] = sum / spp;
}

extern "C" __global__ void __launch_bounds__(256) ray_raster(const uint2* __restrict__ entries,
    const u32* __restrict__ starts, const float4* __restrict__ planes, const float2* __restrict__ offsets,
    const unsigned char* __restrict__ greys, int tile, int columns, int width, int height, int spp, float focal,
    u32* image) {
  extern __shared__ u64 best[];
  int threads = tile * tile, me = threadIdx.x;
  float3* rays = (float3*)(best + threads * spp);
  int x = (blockIdx.x % columns) * tile + me % tile, y = (blockIdx.x / columns) * tile + me / tile;
  for (int s = 0; s < spp; s++) {
    float px = (x + offsets[s].x - .5f * width) / focal, py = (.5f * height - y - offsets[s].y) / focal;
    float r = sqrtf(px * px + py * py), aside = r > 0.f ? __sinf(r) / r : 1.f;
    rays[s * threads + me] = r <= 3.14159265f ? make_float3(px * aside, py * aside, __cosf(r)) : make_float3(0, 0, 0);
    best[s * threads + me] = ~0ull;
  }
  u32 last = starts[blockIdx.x + 1];
  for (u32 i = starts[blockIdx.x]; i < last; i++) {
    uint2 entry = entries[i];
    const float4* at = planes + 3 * (size_t)entry.x;
    float4 n0 = at[0], n1 = at[1], n2 = at[2];  // w of the first: the volume
    for (u32 mask = entry.y; mask; mask &= mask - 1) {
      int s = (__ffs(mask) - 1) * threads + me;
      float3 d = rays[s];
      float a = n0.x * d.x + n0.y * d.y + n0.z * d.z, b = n1.x * d.x + n1.y * d.y + n1.z * d.z;
      float c = n2.x * d.x + n2.y * d.y + n2.z * d.z;
      float low = fminf(fminf(a, b), c), high = fmaxf(fmaxf(a, b), c);
      if (low < 0.f && high > 0.f || low == high && low == 0.f || n0.w > 0.f != high > 0.f) continue;
      if (low == 0.f || high == 0.f) {
        bool up = high > 0.f;
        float4 n = a == 0.f ? n0 : b == 0.f ? n1 : n2;
        float first = n.x != 0.f ? n.x : n.y != 0.f ? n.y : n.z;
        if (first > 0.f != up) continue;
      }
      float far = __fdividef(n0.w, a + b + c);
      keep(best + s, __fdividef(far, 1.f + far), entry.x);
    }
  }
  u32 sum = 0;
  for (int s = 0; s < spp; s++) {
    u64 found = best[s * threads + me];
    sum += found == ~0ull ? 255 : greys[(u32)found];
  }
  if (x < width && y < height) image[y * width + x] = sum / spp;
}
