// Our kernels in CUDA, as the stages of simulator/stages describe them: address calculation, bucket write and tile raster
// of 4x4-vertex grids (Eisenacher & Loop 2010). TILE (pixels), SIDE (sub-tiles a side) come as macros.
typedef unsigned int u32;
#define THREADS (TILE * TILE)
#define BATCH (THREADS / 16)

static __device__ __forceinline__ int4 overlapped(float4 box, int columns, int rows) {
  const float scale = 1.f / TILE;
  int x = max((int)floorf(box.x * scale), 0), y = max((int)floorf(box.y * scale), 0);
  return make_int4(x, y, min(min((int)floorf(box.z * scale), columns - 1), x + 1), min(min((int)floorf(box.w * scale), rows - 1), y + 1));
}
extern "C" __global__ void __launch_bounds__(256) address_calculation(const float4* boxes, int n, int columns, int rows, u32* count, u32* idx) {
  int patch = blockIdx.x * 256 + threadIdx.x;
  if (patch >= n) return;
  int4 o = overlapped(boxes[patch], columns, rows);
  u32 place[4] = {0, 0, 0, 0};
  #pragma unroll
  for (int s = 0; s < 4; s++) {
    int x = o.x + (s & 1), y = o.y + (s >> 1);
    if (x <= o.z && y <= o.w) place[s] = atomicAdd(count + y * columns + x, 1u);
  }
  ((uint4*)idx)[patch] = make_uint4(place[0], place[1], place[2], place[3]);
}
extern "C" __global__ void __launch_bounds__(256) bucket_write(const float4* boxes, int n, int columns, int rows, const u32* start, const u32* idx, u32* lists) {
  int patch = blockIdx.x * 256 + threadIdx.x;
  if (patch >= n) return;
  int4 o = overlapped(boxes[patch], columns, rows);
  uint4 q = ((const uint4*)idx)[patch];
  u32 place[4] = {q.x, q.y, q.z, q.w};
  #pragma unroll
  for (int s = 0; s < 4; s++) {
    int x = o.x + (s & 1), y = o.y + (s >> 1);
    if (x <= o.z && y <= o.w) lists[start[y * columns + x] + place[s]] = patch;
  }
}

static __device__ __forceinline__ float edge(float4 a, float4 b, float x, float y) { return (b.x - a.x) * (y - a.y) - (b.y - a.y) * (x - a.x); }
static __device__ __forceinline__ u32 blend(float4 a, float4 b, float4 c, float u, float v, float w) {
  u32 packed = 0xFF000000u, p = __float_as_uint(a.w), q = __float_as_uint(b.w), r = __float_as_uint(c.w);
  #pragma unroll
  for (int shift = 0; shift < 24; shift += 8)
    packed |= (u32)(u * (float)((p >> shift) & 255) + v * (float)((q >> shift) & 255) + w * (float)((r >> shift) & 255) + 0.5f) << shift;
  return packed;
}
extern "C" __global__ void __launch_bounds__(THREADS) tile_raster(const float4* __restrict__ grids, const u32* __restrict__ start,
    const u32* __restrict__ count, const u32* __restrict__ lists, int columns, int width, int height, u32* image, float* depth) {
  constexpr int SAMPLES = SIDE * SIDE;
  constexpr float SIZE = (float)TILE / SIDE;
  __shared__ float4 vertices[BATCH * 16];
  __shared__ u32 drawn[SIDE > 1 ? SAMPLES * THREADS : 1];
  int t = threadIdx.x, i = t % TILE, j = t / TILE;
  int left = blockIdx.x % columns * TILE, top = blockIdx.x / columns * TILE;
  u32 listed = count[blockIdx.x], first = start[blockIdx.x];
  float z[SAMPLES];
  u32 color[SAMPLES];
  #pragma unroll
  for (int s = 0; s < SAMPLES; s++) { z[s] = 1.f; color[s] = 0xFF402020u; }
  float x0 = left + (i + 0.5f) / SIDE, y0 = top + (j + 0.5f) / SIDE;
  for (u32 base = 0; base < listed; base += BATCH) {
    u32 here = min((u32)BATCH, listed - base);
    __syncthreads();
    if ((u32)(t >> 4) < here) vertices[t] = grids[(size_t)lists[first + base + (t >> 4)] * 16 + (t & 15)];
    __syncthreads();
    for (u32 g = 0; g < here; g++) for (int quad = 0; quad < 9; quad++) {
      const float4* v = vertices + g * 16 + quad + quad / 3;
      float4 a = v[0], b = v[1], c = v[5], d = v[4];
      float lx = fminf(fminf(a.x, b.x), fminf(c.x, d.x)), hx = fmaxf(fmaxf(a.x, b.x), fmaxf(c.x, d.x));
      float ly = fminf(fminf(a.y, b.y), fminf(c.y, d.y)), hy = fmaxf(fmaxf(a.y, b.y), fmaxf(c.y, d.y));
      #pragma unroll
      for (int s = 0; s < SAMPLES; s++) {
        float sx = left + (s % SIDE) * SIZE, sy = top + (s / SIDE) * SIZE;
        if (hx < sx || lx > sx + SIZE || hy < sy || ly > sy + SIZE) continue;
        float x = x0 + (s % SIDE) * SIZE, y = y0 + (s / SIDE) * SIZE;
        if (x < lx || x > hx || y < ly || y > hy) continue;
        float e0 = edge(a, b, x, y), e1 = edge(b, c, x, y), e2 = edge(c, d, x, y), e3 = edge(d, a, x, y);
        if (!((e0 >= 0 && e1 >= 0 && e2 >= 0 && e3 >= 0) || (e0 <= 0 && e1 <= 0 && e2 <= 0 && e3 <= 0))) continue;
        float f = edge(a, c, x, y);
        bool side = (f <= 0) == (e0 + e1 + e2 + e3 >= 0);
        float4 p = side ? b : d;
        float wa = side ? e1 : e2, wb = side ? -f : f, wc = side ? e0 : e3, sum = wa + wb + wc;
        if (sum == 0) continue;
        float r = 1.f / sum, depth_here = (wa * a.z + wb * p.z + wc * c.z) * r;
        if (depth_here < z[s]) { z[s] = depth_here; color[s] = blend(a, p, c, wa * r, wb * r, wc * r); }
      }
    }
  }
  u32 out = color[0];
  if (SIDE > 1) {
    __syncthreads();
    #pragma unroll
    for (int s = 0; s < SAMPLES; s++) drawn[(j + s / SIDE * TILE) * SIDE * TILE + i + s % SIDE * TILE] = color[s];
    __syncthreads();
    out = 0;
    #pragma unroll
    for (int shift = 0; shift < 32; shift += 8) {
      u32 sum = 0;
      for (int s = 0; s < SAMPLES; s++) sum += (drawn[(j * SIDE + s / SIDE) * SIDE * TILE + i * SIDE + s % SIDE] >> shift) & 255;
      out |= (sum + SAMPLES / 2) / SAMPLES << shift;
    }
  }
  int x = left + i, y = top + j;
  if (x < width && y < height) { image[(size_t)y * width + x] = out; if (SIDE == 1) depth[(size_t)y * width + x] = z[0]; }
}
