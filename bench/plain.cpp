// The plain way, as a yardstick: a path tracer in C++ that traces single rays by the same Embree, all in float32.
//
//     plain scene.bin WIDTH HEIGHT SPP THREADS ROBUST     (plain.py writes the file, and starts this)
//
// Spheres and triangles; lambertian, metal with fuzz, dielectric, emitter; a gradient sky, and one rectangular light
// with multiple importance sampling; Russian roulette as in rt.  Serves as worker.py does: a line of JSON when ready, then
// one for each request.  The wheel has no headers of Embree's, so what is used is declared here.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <thread>
#include <vector>

extern "C" {
void *rtcNewDevice(const char *);
void *rtcNewScene(void *);
void *rtcNewGeometry(void *, int);
void rtcSetSceneFlags(void *, int);
void rtcSetSceneBuildQuality(void *, int);
void rtcSetSharedGeometryBuffer(void *, int, unsigned, int, const void *, size_t, size_t, size_t);
void rtcCommitGeometry(void *);
void rtcAttachGeometryByID(void *, void *, unsigned);
void rtcCommitScene(void *);
void rtcIntersect1(void *, void *, const void *);
void rtcOccluded1(void *, void *, const void *);
}

struct alignas(16) RayHit {
  float o[3], tnear, d[3], time, tfar;
  unsigned mask, id, flags;
  float n[3], u, v;
  unsigned prim, geom, inst, place;
};

struct V {
  float x, y, z;
};
V operator+(V a, V b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
V operator-(V a, V b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
V operator*(V a, V b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
V operator*(float s, V a) { return {s * a.x, s * a.y, s * a.z}; }
float dot(V a, V b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
V cross(V a, V b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
V unit(V a) { return (1 / std::sqrt(dot(a, a))) * a; }
float largest(V a) { return std::fmax(a.x, std::fmax(a.y, a.z)); }

constexpr float LEAST_THROUGHPUT = 0.25f;
enum { LAMBERTIAN, METAL, DIELECTRIC, EMITTER };
struct Material {
  int kind;
  V color;
  float parameter;
};
struct Head {
  int spheres, vertices, faces, materials, depth, roulette;
  V eye, corner, right, down, lens_u, lens_v, horizon, zenith, light, edge1, edge2, radiance;
};
const float PI = 3.14159265f;

Head head;
std::vector<float> sphere, vertex;
std::vector<unsigned> face;
std::vector<int> sphere_material, face_material;
std::vector<Material> material;
void *scene;

// PCG32 (O'Neill 2014)
struct Random {
  uint64_t state;
  float next() {
    state = state * 6364136223846793005ull + 1442695040888963407ull;
    uint32_t word = uint32_t(((state >> 18) ^ state) >> 27), turn = state >> 59;
    return (((word >> turn) | (word << (-turn & 31))) >> 8) * 0x1p-24f;
  }
};

V disc(Random &r) {
  float radius = std::sqrt(r.next()), angle = 2 * PI * r.next();
  return {radius * std::cos(angle), radius * std::sin(angle), 0};
}
V ball(Random &r) {
  float z = 1 - 2 * r.next(), radius = std::sqrt(1 - z * z), angle = 2 * PI * r.next();
  return {radius * std::cos(angle), radius * std::sin(angle), z};
}
V cosine_direction(V n, Random &r) {
  V p = disc(r);
  float s = n.z >= 0 ? 1 : -1, a = -1 / (s + n.z), b = n.x * n.y * a;
  V t{1 + s * n.x * n.x * a, s * b, -s * n.x}, q{b, s + n.y * n.y * a, -n.y};
  return p.x * t + p.y * q + std::sqrt(std::fmax(0.f, 1 - p.x * p.x - p.y * p.y)) * n;
}
V sky(V d) { return (0.5f * (1 - d.y)) * head.horizon + (0.5f * (1 + d.y)) * head.zenith; }
float power(float a, float b) { return a * a / (a * a + b * b); }

RayHit ray(V o, V d, float far) {
  RayHit r;
  r.o[0] = o.x, r.o[1] = o.y, r.o[2] = o.z, r.d[0] = d.x, r.d[1] = d.y, r.d[2] = d.z;
  r.tnear = r.time = 0, r.tfar = far, r.mask = ~0u, r.flags = 0, r.geom = r.inst = ~0u;
  return r;
}

V trace(int x, int y, int width, int height, Random random, long &rays) {
  V lens = disc(random), o = head.eye + lens.x * head.lens_u + lens.y * head.lens_v;
  V d = unit(head.corner + ((x + random.next()) / width) * head.right + ((y + random.next()) / height) * head.down - o);
  V weight{1, 1, 1}, sum{0, 0, 0};
  V light_normal = cross(head.edge1, head.edge2);
  float area = std::sqrt(dot(light_normal, light_normal)), pdf = INFINITY;
  if (area > 0) light_normal = (1 / area) * light_normal;
  for (int depth = 1;; depth++) {
    RayHit r = ray(o, d, INFINITY);
    rtcIntersect1(scene, &r, nullptr);
    rays++;
    if (r.geom == ~0u) return sum + weight * sky(d);
    V p = o + r.tfar * d, n;
    float offset;
    int number;
    if (r.geom == 0) {
      const float *s = &sphere[4 * r.prim];
      V c{s[0], s[1], s[2]};
      n = unit(p - c), p = c + s[3] * n, number = sphere_material[r.prim];
      offset = 4.8e-7f * (s[3] + std::fmax(std::fabs(c.x), std::fmax(std::fabs(c.y), std::fabs(c.z))));
    } else {
      const unsigned *f = &face[3 * r.prim];
      const V *v = (const V *)vertex.data();
      n = unit(cross(v[f[1]] - v[f[0]], v[f[2]] - v[f[0]])), number = face_material[r.prim];
      offset = 4.8e-7f * 2;
    }
    const Material &m = material[number];
    bool front = dot(n, d) < 0;
    V facing = front ? n : -1 * n;
    if (m.kind == EMITTER) {
      float c = -dot(light_normal, d);
      float w = std::isinf(pdf) ? 1 : c > 0 ? power(pdf, r.tfar * r.tfar / (area * c)) : 0;
      return sum + w * (weight * m.color);
    }
    if (depth == head.depth) return sum;
    V out, start = p + offset * facing;
    if (m.kind == LAMBERTIAN) {
      if (area > 0) {
        V to = head.light + random.next() * head.edge1 + random.next() * head.edge2 - start;
        float square = dot(to, to), distance = std::sqrt(square);
        to = (1 / distance) * to;
        float c = dot(to, facing), light_c = -dot(to, light_normal);
        if (c > 0 && light_c > 0) {
          float light_pdf = square / (area * light_c), w = power(light_pdf, c / PI) * c / (PI * light_pdf);
          RayHit shadow = ray(start, to, distance * (1 - 1e-5f));
          rtcOccluded1(scene, &shadow, nullptr);
          rays++;
          if (shadow.tfar >= 0) sum = sum + w * (weight * m.color * head.radiance);
        }
      }
      out = cosine_direction(facing, random), pdf = dot(out, facing) / PI, weight = weight * m.color;
    } else if (m.kind == METAL) {
      out = unit(d - (2 * dot(d, facing)) * facing + m.parameter * ball(random)), pdf = INFINITY, weight = weight * m.color;
      if (dot(out, facing) <= 0) return sum;
    } else {
      float eta = front ? 1 / m.parameter : m.parameter, c = -dot(d, facing), k = 1 - eta * eta * (1 - c * c), f = 1;
      if (k > 0) {
        float ct = std::sqrt(k), s = (eta * c - ct) / (eta * c + ct), q = (c - eta * ct) / (c + eta * ct);
        f = 0.5f * (s * s + q * q);
      }
      bool reflects = random.next() < f;
      out = reflects ? d + (2 * c) * facing : unit(eta * d + (eta * c - std::sqrt(k)) * facing);
      if (!reflects) start = p - offset * facing;
      pdf = INFINITY;
    }
    if (depth >= head.roulette) {
      float survival = std::fmin(1.f, largest(weight) / LEAST_THROUGHPUT);
      if (random.next() >= survival) return sum;
      weight = (1 / survival) * weight;
    }
    o = start, d = out;
  }
}

template <class T> void read(std::vector<T> &rows, size_t count, FILE *file) {
  // Embree reads 16 bytes at a time.
  rows.reserve(count + 16 / sizeof(T) + 1), rows.resize(count);
  if (count && fread(rows.data(), sizeof(T), count, file) != count) exit(1);
}

int main(int, char **words) {
  FILE *file = fopen(words[1], "rb");
  if (!file || fread(&head, sizeof head, 1, file) != 1) return 1;
  read(sphere, 4 * head.spheres, file), read(sphere_material, head.spheres, file), read(vertex, 3 * head.vertices, file);
  read(face, 3 * head.faces, file), read(face_material, head.faces, file), read(material, head.materials, file);
  int width = atoi(words[2]), height = atoi(words[3]), spp = atoi(words[4]), threads = atoi(words[5]);
  void *device = rtcNewDevice(nullptr), *geometry;
  scene = rtcNewScene(device);
  rtcSetSceneFlags(scene, atoi(words[6]) ? 4 : 0), rtcSetSceneBuildQuality(scene, 2);
  if (head.spheres) {
    geometry = rtcNewGeometry(device, 50);
    rtcSetSharedGeometryBuffer(geometry, 1, 0, 0x9004, sphere.data(), 0, 16, head.spheres);
    rtcCommitGeometry(geometry), rtcAttachGeometryByID(scene, geometry, 0);
  }
  if (head.faces) {
    geometry = rtcNewGeometry(device, 0);
    rtcSetSharedGeometryBuffer(geometry, 1, 0, 0x9003, vertex.data(), 0, 12, head.vertices);
    rtcSetSharedGeometryBuffer(geometry, 0, 0, 0x5003, face.data(), 0, 12, head.faces);
    rtcCommitGeometry(geometry), rtcAttachGeometryByID(scene, geometry, 1);
  }
  rtcCommitScene(scene);
  printf("{\"threads\": %d, \"sampler\": \"independent\"}\n", threads), fflush(stdout);

  std::vector<V> picture(width * height), before(width * height);
  for (char line[4096]; fgets(line, sizeof line, stdin);) {
    const char *seed_at = strstr(line, "\"seed\":"), *spp_at = strstr(line, "\"spp\":");
    uint64_t seed = seed_at ? strtoull(seed_at + 7, nullptr, 10) : 0;
    int samples = spp_at ? atoi(spp_at + 6) : spp;
    std::atomic<int> next{0};
    std::atomic<long> rays{0};
    auto begin = std::chrono::steady_clock::now();
    auto work = [&] {
      const int tile = 16, columns = (width + tile - 1) / tile, rows = (height + tile - 1) / tile;
      long own = 0;
      for (int k; (k = next++) < columns * rows;)
        for (int y = k / columns * tile; y < std::min(height, (k / columns + 1) * tile); y++)
          for (int x = k % columns * tile; x < std::min(width, (k % columns + 1) * tile); x++) {
            V sum{0, 0, 0};
            for (int s = 0; s < samples; s++) {
              Random random{(seed << 44 ^ uint64_t(y * width + x) << 16 ^ s) * 0x9E3779B97F4A7C15ull};
              random.next(), random.next();
              sum = sum + trace(x, y, width, height, random, own);
            }
            picture[y * width + x] = (1.f / samples) * sum;
          }
      rays += own;
    };
    std::vector<std::thread> pool;
    for (int k = 0; k < threads; k++) pool.emplace_back(work);
    for (auto &thread : pool) thread.join();
    double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    double noise = 0, mean = 0;
    for (int k = 0; k < 3 * width * height; k++) {
      double a = (&picture[0].x)[k], b = (&before[0].x)[k];
      noise += 0.5 * (a - b) * (a - b) / (0.25 * (a + b) * (a + b) + 0.01), mean += a;
    }
    before = picture;
    printf("{\"render\": %.6f, \"rays\": %ld, \"samples\": %ld, \"noise\": %.9g, \"mean\": %.9g}\n", seconds, rays.load(),
           long(width) * height * samples, noise / (3 * width * height), mean / (3 * width * height));
    fflush(stdout);
  }
}
