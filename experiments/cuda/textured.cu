// The textured rasterizer of Ru (2016) in CUDA, in our own words, as the stages of simulator/stages/ru2016 describe it: the
// same records, the same loops and the same order of operations, so that its machine code has the same blocks to count.
typedef unsigned char u8;
typedef unsigned short u16;
#define IN static __device__ __forceinline__
struct V2 { float x, y; };
struct V3 { float x, y, z; };
struct V4 { float x, y, z, w; };
struct Vertex { V4 place; V3 eye, normal; V2 uv; const u8* texture; int width, height; };   // 64 bytes
struct Triangle { int kind; Vertex v[3]; };                                                  // 200 bytes
struct Fragment { V3 eye, normal; V2 uv; const u8* texture; int width, height, shade; };     // 56 bytes
struct Draw { const u16* indices; const V3 *positions, *normals; const V2* uvs; const u8* texture; int width, height; Vertex* vertices; int mode, kind; };
struct M4 { V4 c[4]; };                                                                      // columns
struct M3 { V3 c[3]; };

// by reference: a vector alone is aligned to 4 bytes, so it is read word by word
IN V2 operator*(const V2& a, float s) { return {a.x * s, a.y * s}; }
IN V2 operator+(const V2& a, const V2& b) { return {a.x + b.x, a.y + b.y}; }
IN V2 operator-(const V2& a, const V2& b) { return {a.x - b.x, a.y - b.y}; }
IN V3 operator*(const V3& a, float s) { return {a.x * s, a.y * s, a.z * s}; }
IN V3 operator*(float s, const V3& a) { return {s * a.x, s * a.y, s * a.z}; }
IN V3 operator+(const V3& a, const V3& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
IN float dot(const V3& a, const V3& b) { float x = a.x * b.x, y = a.y * b.y, z = a.z * b.z; return x + y + z; }
IN V3 unit(V3 a) { return a * (1.f / sqrtf(dot(a, a))); }
IN int least(int a, int b) { return b < a ? b : a; }
IN int most(int a, int b) { return a < b ? b : a; }
IN float most(float a, float b) { return a < b ? b : a; }
IN V4 times(const M4& m, V4 v) {
  V4 r;
  r.x = (m.c[0].x * v.x + m.c[1].x * v.y) + (m.c[2].x * v.z + m.c[3].x * v.w);
  r.y = (m.c[0].y * v.x + m.c[1].y * v.y) + (m.c[2].y * v.z + m.c[3].y * v.w);
  r.z = (m.c[0].z * v.x + m.c[1].z * v.y) + (m.c[2].z * v.z + m.c[3].z * v.w);
  r.w = (m.c[0].w * v.x + m.c[1].w * v.y) + (m.c[2].w * v.z + m.c[3].w * v.w);
  return r;
}

// ---- vertices and primitives ----
extern "C" __global__ void vertex_shading(int count, Draw d, M4 clip, M4 view, M3 normals, int width, int height) {
  int i = blockIdx.x * blockDim.x + threadIdx.x;
  if (i >= count) return;
  V3 p = d.positions[i], n = d.normals[i];
  V4 e = times(view, {p.x, p.y, p.z, 1.f});
  V3 turned = {normals.c[0].x * n.x + normals.c[1].x * n.y + normals.c[2].x * n.z,
               normals.c[0].y * n.x + normals.c[1].y * n.y + normals.c[2].y * n.z,
               normals.c[0].z * n.x + normals.c[1].z * n.y + normals.c[2].z * n.z};
  V3 normal = unit(turned);
  V4 c = times(clip, {p.x, p.y, p.z, 1.f});
  Vertex& out = d.vertices[i];
  out.place = {(c.x / c.w + 1.f) * .5f * (float)width, (c.y / c.w + 1.f) * .5f * (float)height, c.z, c.w};
  out.eye = {e.x, e.y, e.z};
  out.normal = normal;
  if (d.uvs) out.uv = d.uvs[i];
  if (d.texture) out.texture = d.texture;
  out.width = d.width;
  out.height = d.height;
}
extern "C" __global__ void primitive_assembly(int count, int first, Triangle* triangles, Draw d) {
  int i = blockIdx.x * blockDim.x + threadIdx.x;
  if (i < count && d.mode == 4) triangles[i / d.kind + first].v[i % d.kind] = d.vertices[d.indices[i]];
}

// ---- what the rasters share ----
IN float area(V3 a, V3 b, V3 c) { return 0.5 * ((c.x - a.x) * (b.y - a.y) - (b.x - a.x) * (c.y - a.y)); }
IN V3 weights(const V3 t[3], V2 p) {
  V3 q = {p.x, p.y, 0.f};
  float b = area(t[0], q, t[2]) / area(t[0], t[1], t[2]), c = area(t[0], t[1], q) / area(t[0], t[1], t[2]);
  float a = 1.0 - b - c;
  return {a, b, c};
}
IN bool inside(V3 w) { return w.x >= 0.0 && w.x <= 1.0 && w.y >= 0.0 && w.y <= 1.0 && w.z >= 0.0 && w.z <= 1.0; }
IN float blend(V3 w, float a, float b, float c) { return w.x * a + w.y * b + w.z * c; }
IN V3 blend(V3 w, V3 a, V3 b, V3 c) { return w.x * a + w.y * b + w.z * c; }
IN V2 blend(V3 w, V2 a, V2 b, V2 c) { return a * w.x + b * w.y + c * w.z; }
IN V3 corner(const V4& v) { return {v.x, v.y, v.z}; }
IN bool front(const V3 t[3]) { return (t[1].x - t[0].x) * (t[2].y - t[0].y) - (t[1].y - t[0].y) * (t[2].x - t[0].x) > 0.f; }
struct Box { V3 low, high; };
IN Box box(const V3 t[3]) {
  return {{fminf(fminf(t[0].x, t[1].x), t[2].x), fminf(fminf(t[0].y, t[1].y), t[2].y), fminf(fminf(t[0].z, t[1].z), t[2].z)},
          {fmaxf(fmaxf(t[0].x, t[1].x), t[2].x), fmaxf(fmaxf(t[0].y, t[1].y), t[2].y), fmaxf(fmaxf(t[0].z, t[1].z), t[2].z)}};
}

// ---- tile lists: a thread a triangle; five axes may separate it from a tile ----
IN void reach(V2 axis, V2 p, float& low, float& high) {
  float x = axis.x * p.x, y = axis.y * p.y, d = x + y;
  low = d < low ? d : low;
  high = d > high ? d : high;
}
IN bool meet(V2 low, V2 high, const V3 t[3]) {
  V2 c = {(high.x + low.x) * .5f, (high.y + low.y) * .5f};
  float x = (high.x - low.x) * .5f, y = (high.y - low.y) * .5f;
  V2 b[4] = {{-x, -y}, {x, -y}, {x, y}, {-x, y}};
  V2 v[3] = {V2{t[0].x, t[0].y} - c, V2{t[1].x, t[1].y} - c, V2{t[2].x, t[2].y} - c};
  V2 e[3] = {v[1] - v[0], v[2] - v[1], v[0] - v[2]};
  V2 axes[5] = {{1.f, 0.f}, {0.f, 1.f}, {-e[0].y, e[0].x}, {-e[1].y, e[1].x}, {-e[2].y, e[2].x}};
  for (int i = 0; i < 5; i++) {
    float box_low = 3.402823466e+38F, box_high = -box_low, low_t = box_low, high_t = -box_low;
    for (int k = 0; k < 4; k++) reach(axes[i], b[k], box_low, box_high);
    for (int k = 0; k < 3; k++) reach(axes[i], v[k], low_t, high_t);
    if (low_t > box_high || high_t < box_low) return false;
  }
  return true;
}
template <int TILE, bool CULL> static __global__ void tile_lists(int count, int columns, int rows, int room, const Triangle* triangles, int* sizes, int* lists) {
  int i = blockDim.x * blockIdx.x + threadIdx.x;
  if (i >= count) return;
  const Triangle& triangle = triangles[i];
  V3 t[3] = {corner(triangle.v[0].place), corner(triangle.v[1].place), corner(triangle.v[2].place)};
  if (CULL && !front(t)) return;
  Box b = box(t);
  int left = most(0, (int)floorf((b.low.x + .5f) / TILE)), right = least(columns - 1, (int)floorf((b.high.x + .5f) / TILE));
  int first = most(0, (int)floorf((b.low.y + .5f) / TILE)), last = least(rows - 1, (int)floorf((b.high.y + .5f) / TILE));
  for (int y = first; y <= last; y++)
    for (int x = left; x <= right; x++)
      if (meet({float(x * TILE) - .5f, float(y * TILE) - .5f}, {float((x + 1) * TILE) - .5f, float((y + 1) * TILE) - .5f}, t)) {
        int tile = y * columns + x, place = atomicAdd(&sizes[tile], 1);
        lists[tile * room + place] = i;
      }
}

// ---- tiled raster: a block a tile, a thread a pixel ----
template <int TILE> static __global__ void tiled_raster(int count, int width, int height, int columns, int rows, int room,
    const Triangle* triangles, const int* sizes, const int* lists, int* depths, Fragment* fragments) {
  float nearest = 1.f;
  Fragment f{};
  int x = blockIdx.x * TILE + threadIdx.x, y = blockIdx.y * TILE + threadIdx.y, pixel = y * width + x;
  int tile = blockIdx.y * columns + blockIdx.x, n = sizes[tile];
  const int* list = lists + room * tile;
  if (x >= width || y >= height) return;
  for (int i = 0; i < n; i++) {
    const Triangle& p = triangles[list[i]];
    V3 t[3] = {corner(p.v[0].place), corner(p.v[1].place), corner(p.v[2].place)};
    V3 w = weights(t, {(float)x, (float)y});
    if (inside(w)) {
      float r0 = 1.f / p.v[0].place.w, r1 = 1.f / p.v[1].place.w, r2 = 1.f / p.v[2].place.w;
      float far = 1.f / blend(w, r0, r1, r2), z = blend(w, t[0].z * r0, t[1].z * r1, t[2].z * r2);
      if (z > -1.f && z < nearest) {
        nearest = z;
        f.eye = blend(w, p.v[0].eye * r0, p.v[1].eye * r1, p.v[2].eye * r2) * far;
        f.normal = unit(blend(w, p.v[0].normal * r0, p.v[1].normal * r1, p.v[2].normal * r2) * far);
        f.uv = blend(w, p.v[0].uv * r0, p.v[1].uv * r1, p.v[2].uv * r2) * far;
        f.texture = p.v[0].texture;
        f.width = p.v[0].width;
        f.height = p.v[0].height;
        f.shade = true;
      }
    }
  }
  depths[pixel] = (int)(nearest * 2147483647);
  fragments[pixel] = f;
}

// ---- per primitive: a thread a triangle; the fragment is written unprotected ----
template <bool CULL> static __global__ void per_primitive_raster(int count, int width, int height, const Triangle* triangles, int* depths, Fragment* fragments) {
  int i = blockDim.x * blockIdx.x + threadIdx.x;
  if (i >= count) return;
  const Triangle& p = triangles[i];
  V3 t[3] = {corner(p.v[0].place), corner(p.v[1].place), corner(p.v[2].place)};
  if (CULL && !front(t)) return;
  Box b = box(t);
  int left = least(width - 1, most(0, (int)b.low.x)), right = least(width - 1, most(0, (int)b.high.x));
  int low = least(height - 1, most(0, (int)b.low.y)), high = least(height - 1, most(0, (int)b.high.y));
  for (int x = left; x <= right; x++)
    for (int y = low; y <= high; y++) {
      V3 w = weights(t, {(float)x, (float)y});
      if (inside(w)) {
        int pixel = y * width + x;
        float r0 = 1.f / p.v[0].place.w, r1 = 1.f / p.v[1].place.w, r2 = 1.f / p.v[2].place.w;
        float far = 1.f / blend(w, r0, r1, r2), z = blend(w, t[0].z * r0, t[1].z * r1, t[2].z * r2);
        if (z > -1.f && z < 1.f) {
          int depth = (int)(z * 2147483647), before = atomicMin(&depths[pixel], depth);
          if (depth < before) {
            fragments[pixel].eye = blend(w, p.v[0].eye * r0, p.v[1].eye * r1, p.v[2].eye * r2) * far;
            fragments[pixel].normal = unit(blend(w, p.v[0].normal * r0, p.v[1].normal * r1, p.v[2].normal * r2) * far);
            if (p.v[0].texture) {
              fragments[pixel].uv = blend(w, p.v[0].uv * r0, p.v[1].uv * r1, p.v[2].uv * r2) * far;
              fragments[pixel].texture = p.v[0].texture;
              fragments[pixel].width = p.v[0].width;
              fragments[pixel].height = p.v[0].height;
            }
            fragments[pixel].shade = 1;
          }
        }
      }
    }
}
extern "C" __global__ void init_depth(int width, int height, int* depths) {
  int x = blockIdx.x * blockDim.x + threadIdx.x, y = blockIdx.y * blockDim.y + threadIdx.y;
  if (x < width && y < height) depths[x + y * width] = 2147483647;
}

// ---- shading, and the copy to the window ----
IN V3 texel(const u8* t, int i) { return {t[i * 3] / 255.f, t[i * 3 + 1] / 255.f, t[i * 3 + 2] / 255.f}; }
template <bool BILINEAR> static __global__ void fragment_shading(int w, int h, const Fragment* fragments, V3* colors) {
  int x = blockIdx.x * blockDim.x + threadIdx.x, y = blockIdx.y * blockDim.y + threadIdx.y, i = x + y * w;
  if (!(x < w && y < h && fragments[i].shade)) return;
  V3 light = unit({1.f, 1.f, 1.f}), base = {1.f, 1.f, 1.f};
  if (fragments[i].texture) {
    int width = fragments[i].width, height = fragments[i].height;
    V2 uv = fragments[i].uv;
    const u8* texture = fragments[i].texture;
    if (BILINEAR) {
      float u = uv.x * width - .5f, v = uv.y * height - .5f, a = u - floorf(u), b = v - floorf(v);
      int s = least(width - 2, most(0, (int)u)), t = least(height - 2, most(0, (int)v));
      V3 p = texel(texture, t * width + s), q = texel(texture, t * width + s + 1);
      V3 r = texel(texture, (t + 1) * width + s), z = texel(texture, (t + 1) * width + s + 1);
      base = (1.f - b) * ((1.f - a) * p + a * q) + b * ((1.f - a) * r + a * z);
    } else {
      int s = least(width - 1, most(0, (int)(uv.x * width))), t = least(height - 1, most(0, (int)(uv.y * height)));
      base = texel(texture, t * width + s);
    }
  }
  V3 normal = fragments[i].normal, half = unit(light + V3{0.f, 0.f, 1.f});
  float shine = most(0.f, dot(half, normal)), shade = most(0.f, dot(light, normal));
  colors[i] = .1f * V3{1.f, 1.f, 1.f} + .5f * base * shade + .5f * V3{1.f, 1.f, 1.f} * powf(shine, 20.f);
}
IN float clamped(float v) { float m = v < 0.f ? 0.f : v; return 1.f < m ? 1.f : m; }
extern "C" __global__ void copy(uchar4* window, int w, int h, const V3* colors) {
  int x = blockIdx.x * blockDim.x + threadIdx.x, y = blockIdx.y * blockDim.y + threadIdx.y, i = x + y * w;
  int out = w - x - 1 + (h - y - 1) * w;
  if (x < w && y < h) {
    V3 c = {(float)(clamped(colors[i].x) * 255.0), (float)(clamped(colors[i].y) * 255.0), (float)(clamped(colors[i].z) * 255.0)};
    window[out].w = 0;
    window[out].x = c.x;
    window[out].y = c.y;
    window[out].z = c.z;
  }
}
#define LISTS(T, C) template __global__ void tile_lists<T, C>(int, int, int, int, const Triangle*, int*, int*);
#define RASTER(T) template __global__ void tiled_raster<T>(int, int, int, int, int, int, const Triangle*, const int*, const int*, int*, Fragment*);
LISTS(4, true) LISTS(8, true) LISTS(16, true) LISTS(32, true) LISTS(8, false)
RASTER(4) RASTER(8) RASTER(16) RASTER(32)
template __global__ void per_primitive_raster<true>(int, int, int, const Triangle*, int*, Fragment*);
template __global__ void per_primitive_raster<false>(int, int, int, const Triangle*, int*, Fragment*);
template __global__ void fragment_shading<true>(int, int, const Fragment*, V3*);
template __global__ void fragment_shading<false>(int, int, const Fragment*, V3*);
