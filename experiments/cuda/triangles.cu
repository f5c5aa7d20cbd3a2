// Our triangle kernels in CUDA, as the stages of simulator/stages describe them: FreePipe (Liu et al. 2010) and the
// triangle setup of CudaRaster as nvdiffrast has it (Laine & Karras 2011), for triangles that need no clipping.
typedef unsigned char u8;
typedef unsigned int u32;
typedef unsigned long long u64;
struct Vertex { float4 p; float r; int x, y; };  // clip position, 1/w, snapped to 1/16 pixel

static __device__ __forceinline__ bool inside(float4 p) { return p.w >= fmaxf(fmaxf(fabsf(p.x), fabsf(p.y)), fabsf(p.z)); }
static __device__ __forceinline__ Vertex snap(float4 p, float sx, float sy) {
  float r = __fdiv_rn(1.f, p.w);
  return {p, r, __float2int_rn(__fmul_rn(__fmul_rn(p.x, r), sx)), __float2int_rn(__fmul_rn(__fmul_rn(p.y, r), sy))};
}
static __device__ __forceinline__ int bias(int dx, int dy) { return dy < 0 || (dy == 0 && dx > 0) ? 0 : 1; }

// ---- FreePipe: a thread scans the box of its triangle; one 64-bit minimum of depth and triangle a covered pixel ----
template <bool EARLY> static __device__ __forceinline__ void scan(const float4* positions, const int* triangles, int n,
    int width, int height, u64* frame, u32* clipped) {
  int t = blockIdx.x * blockDim.x + threadIdx.x;
  if (t >= n) return;
  float4 p = positions[triangles[3 * t]], q = positions[triangles[3 * t + 1]], s = positions[triangles[3 * t + 2]];
  if (!inside(p) || !inside(q) || !inside(s)) { atomicAdd(clipped, 1u); return; }
  Vertex a = snap(p, 8.f * width, 8.f * height), b = snap(q, 8.f * width, 8.f * height), c = snap(s, 8.f * width, 8.f * height);
  a.x += 8 * width; b.x += 8 * width; c.x += 8 * width;
  a.y += 8 * height; b.y += 8 * height; c.y += 8 * height;
  int area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
  if (area == 0) return;
  if (area < 0) { Vertex swap = b; b = c; c = swap; area = -area; }
  int left = max((min(a.x, min(b.x, c.x)) + 7) >> 4, 0), right = min((max(a.x, max(b.x, c.x)) - 8) >> 4, width - 1);
  int low = max((min(a.y, min(b.y, c.y)) + 7) >> 4, 0), high = min((max(a.y, max(b.y, c.y)) - 8) >> 4, height - 1);
  if (left > right || low > high) return;
  int abx = b.x - a.x, aby = b.y - a.y, bcx = c.x - b.x, bcy = c.y - b.y, cax = a.x - c.x, cay = a.y - c.y;
  int x = left * 16 + 8, y = low * 16 + 8;
  int e0 = abx * (y - a.y) - aby * (x - a.x) - bias(abx, aby);
  int e1 = bcx * (y - b.y) - bcy * (x - b.x) - bias(bcx, bcy);
  int e2 = cax * (y - c.y) - cay * (x - c.x) - bias(cax, cay);
  float za = a.p.z * a.r, zb = b.p.z * b.r, zc = c.p.z * c.r, r = __fdiv_rn(1.f, (float)area);
  float zx = (-((zc - za) * (float)aby) + (zb - za) * (float)-cay) * r, zy = ((zc - za) * (float)abx + (zb - za) * (float)cax) * r;
  float row_z = za + zx * (float)(x - a.x) + zy * (float)(y - a.y);
  for (int j = low; j <= high; j++) {
    int f0 = e0, f1 = e1, f2 = e2;
    float z = row_z;
    u64* row = frame + (size_t)j * width;
    for (int i = left; i <= right; i++) {
      if ((f0 | f1 | f2) >= 0) {
        u64 value = (u64)__float2uint_rn(__saturatef(z * .5f + .5f) * 4294967040.f) << 32 | (u32)(t + 1);
        if (!EARLY || __ldcg(row + i) > value) atomicMin(row + i, value);
      }
      f0 -= aby * 16; f1 -= bcy * 16; f2 -= cay * 16; z += zx * 16.f;
    }
    e0 += abx * 16; e1 += bcx * 16; e2 += cax * 16; row_z += zy * 16.f;
  }
}
extern "C" __global__ void __launch_bounds__(256) freepipe(const float4* p, const int* t, int n, int w, int h, u64* f, u32* c) { scan<false>(p, t, n, w, h, f, c); }
extern "C" __global__ void __launch_bounds__(256) freepipe_early(const float4* p, const int* t, int n, int w, int h, u64* f, u32* c) { scan<true>(p, t, n, w, h, f, c); }

// ---- triangle setup: cull, snap, header and depth plane; one record a triangle, in its own slot ----
static __device__ __forceinline__ bool holds(Vertex a, Vertex b, Vertex c, int x, int y, int sign) {
  int ax = a.x - x, ay = a.y - y, bx = b.x - x, by = b.y - y, cx = c.x - x, cy = c.y - y;
  return sign * (ax * by - ay * bx) >= 0 && sign * (bx * cy - by * cx) >= 0 && sign * (cx * ay - cy * ax) >= 0;
}
static __device__ __forceinline__ bool between_samples(Vertex a, Vertex b, Vertex c, int width, int height, int sign) {
  int bx = 8 * width - 8, by = 8 * height - 8;
  int left = (min(a.x, min(b.x, c.x)) + 15 + bx) & -16, right = (max(a.x, max(b.x, c.x)) + bx) & -16;
  int low = (min(a.y, min(b.y, c.y)) + 15 + by) & -16, high = (max(a.y, max(b.y, c.y)) + by) & -16;
  if (left > right || low > high) return true;
  int spread = right - left + high - low;
  if (spread > 16 || holds(a, b, c, left - bx, low - by, sign)) return false;
  return spread == 0 || !holds(a, b, c, right - bx, high - by, sign);
}
static __device__ __forceinline__ u32 flips(Vertex a, Vertex b) {
  int dx = b.x - a.x, dy = b.y - a.y;
  u32 f = 0;
  if (dy > 0 || (dy == 0 && dx <= 0)) f ^= 11;
  if (dx > 0) f ^= 3;
  if (abs(dx) < abs(dy)) f ^= 5;
  return f;
}
static __device__ __forceinline__ float depth_of(Vertex a) { return __fmaf_rn(__fmul_rn(a.p.z, 2147465984.f), a.r, 2147483648.f); }
static __device__ __forceinline__ uint3 plane(u32 u0, u32 u1, u32 u2, int sh, int ox, int oy, int e1x, int e1y, int e2x, int e2y, u32 mantissa, int shift) {
  int t0 = u0 >> sh, t1 = (int)(u1 >> sh) - t0, t2 = (int)(u2 >> sh) - t0;
  long long xc = ((long long)t1 * e2y - (long long)t2 * e1y) * mantissa, yc = ((long long)t2 * e1x - (long long)t1 * e2x) * mantissa;
  u32 px = (u32)(xc >> (shift - (sh + 4))), py = (u32)(yc >> (shift - (sh + 4)));
  int cx = (2 * ox + min(min(e1x, e2x), 0) + max(max(e1x, e2x), 0)) >> 5, cy = (2 * oy + min(min(e1y, e2y), 0) + max(max(e1y, e2y), 0)) >> 5;
  long long centre = ((xc >> 13) * (ox - (cx << 4)) + (yc >> 13) * (oy - (cy << 4))) >> (shift - (sh + 13));
  return make_uint3(px, py, (u32)((long long)t0 << sh) - (u32)centre - (px * cx + py * cy));
}
extern "C" __global__ void __launch_bounds__(64) triangle_setup(const float4* positions, const int* triangles, int n,
    int width, int height, u8* kept, uint4* headers, uint4* planes, u32* clipped) {
  int t = blockIdx.x * 64 + threadIdx.x;
  if (t >= n) return;
  kept[t] = 0;
  float4 p = positions[triangles[3 * t]], q = positions[triangles[3 * t + 1]], s = positions[triangles[3 * t + 2]];
  if (!inside(p) || !inside(q) || !inside(s)) { atomicAdd(clipped, 1u); return; }
  Vertex a = snap(p, 8.f * width, 8.f * height), b = snap(q, 8.f * width, 8.f * height), c = snap(s, 8.f * width, 8.f * height);
  int area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
  if (area == 0 || between_samples(a, b, c, width, height, area > 0 ? 1 : -1)) return;
  if (area < 0) { Vertex swap = b; b = c; c = swap; area = -area; }
  float za = depth_of(a), zb = depth_of(b), zc = depth_of(c);
  u32 nearest = __float2uint_rn(fminf(fminf(za, zb), zc) - 2200.f) & 0xFFFFF000u;
  headers[t] = make_uint4((a.x & 0xFFFF) | (u32)a.y << 16, (b.x & 0xFFFF) | (u32)b.y << 16, (c.x & 0xFFFF) | (u32)c.y << 16,
    nearest | flips(a, b) << 8 | flips(b, c) << 4 | flips(c, a));
  u32 bits = __float_as_uint(__fdiv_rn(1.f, (float)area)), mantissa = (bits & 0x7FFFFF) | 0x800000;
  int sh = min(max((int)(__float_as_uint(fmaxf(fmaxf(za, zb), zc)) >> 23) - 149, 0), 8);
  uint3 z = plane(__float2uint_rz(za), __float2uint_rz(zb), __float2uint_rz(zc), sh, a.x + 8 * width - 8, a.y + 8 * height - 8,
    b.x - a.x, b.y - a.y, c.x - a.x, c.y - a.y, mantissa, 150 - (int)(bits >> 23));
  planes[t] = make_uint4(z.x, z.y, z.z, t + 1);
  kept[t] = 1;
}
