// Motion blur and defocus of quads in CUDA, as simulator/stages/fatahalian2009/motion*.py describe them (Fatahalian et
// al. 2009): a lane a polygon, warps that draw polygons from a queue. Coverage is exact on the grid of 1/4096 pixel, in
// 64-bit products; places and depths are floats, where the simulator rounds doubles to float once.
typedef unsigned int u32;
typedef unsigned long long u64;
typedef long long s64;
struct __align__(16) Sample { float t, u, v; u32 place; }; // place: x and y in the pixel, 1/4096, 16 bits each
struct Interval { float t0, t1, u0, u1, v0, v1; };
struct Quad { float x[4], y[4], z[4], dx[4], dy[4], dz[4], blur[4]; };
struct Placed { int x[4], y[4]; float z[4]; };        // snapped
__constant__ Sample tuples[1024];                     // interleaved: the samples of a tile of pixels
__constant__ Interval intervals[64];

static __device__ __forceinline__ int draw(u32* queue, int n) {  // first polygon of the warp, n where none is left
  u32 unit = 0;
  if ((threadIdx.x & 31) == 0) unit = atomicAdd(queue, 1u);
  return min((int)__shfl_sync(~0u, unit, 0) * 32, n);
}
static __device__ __forceinline__ Quad load(const float* planes, int n, int p) {
  Quad q;
  #pragma unroll
  for (int k = 0; k < 4; k++) {
    const float* at = planes + p + (size_t)k * 7 * n;
    q.x[k] = at[0]; q.y[k] = at[n]; q.z[k] = at[2 * (size_t)n];
    q.dx[k] = at[3 * (size_t)n]; q.dy[k] = at[4 * (size_t)n]; q.dz[k] = at[5 * (size_t)n];  // end minus start
    q.blur[k] = at[6 * (size_t)n];
  }
  return q;
}
static __device__ __forceinline__ Placed place(const Quad& q, float t, float u, float v) {
  Placed p;
  #pragma unroll
  for (int k = 0; k < 4; k++) {
    p.x[k] = __float2int_rd((q.x[k] + t * q.dx[k] + q.blur[k] * u) * 4096.f + .5f);
    p.y[k] = __float2int_rd((q.y[k] + t * q.dy[k] + q.blur[k] * v) * 4096.f + .5f);
    p.z[k] = q.z[k] + t * q.dz[k];
  }
  return p;
}
struct Edge { int a, b; s64 c; };  // inside: a x + b y + c >= 0
static __device__ __forceinline__ Edge edge(const Placed& p, int i, int j, bool turn) {
  int a = p.y[i] - p.y[j], b = p.x[j] - p.x[i];
  if (turn) { a = -a; b = -b; }
  bool owns = a > 0 || (a == 0 && b > 0);
  return {a, b, -((s64)a * p.x[i] + (s64)b * p.y[i]) - !owns};
}
struct Triangle { Edge e[3]; bool empty; };
static __device__ __forceinline__ Triangle triangle(const Placed& p, int j, int k) {
  s64 area = (s64)(p.x[j] - p.x[0]) * (p.y[k] - p.y[0]) - (s64)(p.y[j] - p.y[0]) * (p.x[k] - p.x[0]);
  bool turn = area < 0;
  return {{edge(p, 0, j, turn), edge(p, j, k, turn), edge(p, k, 0, turn)}, area == 0};
}
static __device__ __forceinline__ s64 value(const Edge& e, int x, int y) { return (s64)e.a * x + (s64)e.b * y + e.c; }
struct Tested { s64 v[3]; bool in; };
static __device__ __forceinline__ Tested test(const Triangle& t, int x, int y) {
  s64 a = value(t.e[0], x, y), b = value(t.e[1], x, y), c = value(t.e[2], x, y);
  return {{a, b, c}, !t.empty && (a | b | c) >= 0};
}
static __device__ __forceinline__ void keep(const Tested& s, float z0, float z1, float z2, u64* at, int p) {
  float a = (float)s.v[1], b = (float)s.v[2], c = (float)s.v[0];
  float z = __fdividef(a * z0 + b * z1 + c * z2, a + b + c);
  atomicMin(at, (u64)__float_as_uint(z) << 32 | (u32)p);
}
static __device__ __forceinline__ void test_quad(const Triangle& one, const Triangle& two, const float* z, int x, int y, u64* at, int p) {
  Tested s = test(one, x, y), r = test(two, x, y);
  if (s.in || r.in) {
    Tested h = s.in ? s : r;
    keep(h, z[0], s.in ? z[1] : z[2], s.in ? z[2] : z[3], at, p);
  }
}

extern "C" __global__ void __launch_bounds__(128) interval(const float* planes, const Sample* __restrict__ pattern, int n,
    int count, int spp, int width, int height, u32* queue, u64* frame) {
  for (int first = draw(queue, n); first < n; first = draw(queue, n)) {
    int p = first + (threadIdx.x & 31);
    if (p >= n) continue;
    Quad q = load(planes, n, p);
    for (int m = 0; m < count; m++) {
      Interval w = intervals[m];
      float x0 = 1e30f, y0 = 1e30f, x1 = -1e30f, y1 = -1e30f;
      #pragma unroll
      for (int k = 0; k < 4; k++) {
        float xa = q.x[k] + w.t0 * q.dx[k], xb = q.x[k] + w.t1 * q.dx[k];
        float ya = q.y[k] + w.t0 * q.dy[k], yb = q.y[k] + w.t1 * q.dy[k];
        x0 = fminf(x0, fminf(xa, xb) + q.blur[k] * w.u0); x1 = fmaxf(x1, fmaxf(xa, xb) + q.blur[k] * w.u1);
        y0 = fminf(y0, fminf(ya, yb) + q.blur[k] * w.v0); y1 = fmaxf(y1, fmaxf(ya, yb) + q.blur[k] * w.v1);
      }
      int left = max(__float2int_rd(x0 - 1.f / 64), 0), right = min(__float2int_rd(x1 + 1.f / 64), width - 1);
      int top = max(__float2int_rd(y0 - 1.f / 64), 0), low = min(__float2int_rd(y1 + 1.f / 64), height - 1);
      if (left > right || top > low) continue;
      int s0 = m * spp / count, s1 = (m + 1) * spp / count, x = left, y = top, s = s0;
      do {
        Sample at = pattern[((y & 31) * 32 + (x & 31)) * spp + s];
        Placed now = place(q, at.t, at.u, at.v);
        Triangle one = triangle(now, 1, 2), two = triangle(now, 2, 3);
        test_quad(one, two, now.z, x * 4096 + (at.place & 0xffff), y * 4096 + (at.place >> 16),
                  frame + ((size_t)y * width + x) * spp + s, p);
        bool row = ++s == s1;
        s = row ? s0 : s; x += row;
        bool end = x > right;
        x = end ? left : x; y += end;
      } while (y <= low);
    }
  }
}

extern "C" __global__ void __launch_bounds__(128) interleaved(const float* planes, int n, int tile, int spp, int width,
    int height, u32* queue, u64* frame) {
  for (int first = draw(queue, n); first < n; first = draw(queue, n)) {
    int p = first + (threadIdx.x & 31);
    if (p >= n) continue;
    Quad q = load(planes, n, p);
    for (int i = 0, e = 0; i < tile; i++) for (int j = 0; j < tile; j++) for (int s = 0; s < spp; s++, e++) {
      Sample at = tuples[e];
      Placed now = place(q, at.t, at.u, at.v);
      int x0 = max(min(min(now.x[0], now.x[1]), min(now.x[2], now.x[3])), 0) >> 12;
      int y0 = max(min(min(now.y[0], now.y[1]), min(now.y[2], now.y[3])), 0) >> 12;
      int x1 = min(max(max(now.x[0], now.x[1]), max(now.x[2], now.x[3])) >> 12, width - 1);
      int y1 = min(max(max(now.y[0], now.y[1]), max(now.y[2], now.y[3])) >> 12, height - 1);
      int left = x0 + ((j - x0) & (tile - 1)), y = y0 + ((i - y0) & (tile - 1)), x = left;  // tiles are powers of two
      if (left > x1 || y > y1) continue;
      Triangle one = triangle(now, 1, 2), two = triangle(now, 2, 3);
      do {
        test_quad(one, two, now.z, x * 4096 + (at.place & 0xffff), y * 4096 + (at.place >> 16),
                  frame + ((size_t)y * width + x) * spp + s, p);
        x += tile;
        bool end = x > x1;
        x = end ? left : x; y += end ? tile : 0;
      } while (y <= y1);
    }
  }
}
