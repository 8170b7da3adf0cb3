// Projections onto images, image lookups, Fresnel and bump.
#include "shader/kernels/ops.h"

namespace talbot::shader {
inline namespace TALBOT_ISA {

void op_project(const Instruction& i, Registers r, int n) {
    Column u = r[0], v = r[1];
    ConstColumn x = r[2], y = r[3], z = r[4];
    switch (ProjectKind(i.variant)) {
        case ProjectKind::Sphere:
            TALBOT_VECTOR_LOOP
            for (int k = 0; k < n; ++k) {
                const float l = std::sqrt(x[k] * x[k] + y[k] * y[k] + z[k] * z[k]);
                const bool axis = x[k] == 0.0f && y[k] == 0.0f;
                u[k] = axis ? 0.0f : 0.5f - lane_atan2(x[k], y[k]) * (0.5f * kInvPi);
                v[k] = l > 0.0f ? 1.0f - lane_acos(z[k] / (l > 0.0f ? l : 1.0f)) * kInvPi : 0.0f;
            }
            return;
        case ProjectKind::Tube:
            TALBOT_VECTOR_LOOP
            for (int k = 0; k < n; ++k) {
                const bool axis = x[k] == 0.0f && y[k] == 0.0f;
                u[k] = axis ? 0.0f : 0.5f - lane_atan2(x[k], y[k]) * (0.5f * kInvPi);
                v[k] = axis ? 0.0f : (z[k] + 1.0f) * 0.5f;
            }
            return;
        case ProjectKind::Equirectangular:
            TALBOT_VECTOR_LOOP
            for (int k = 0; k < n; ++k) {
                const float l = std::sqrt(x[k] * x[k] + y[k] * y[k] + z[k] * z[k]);
                u[k] = 0.5f - lane_atan2(y[k], x[k]) * (0.5f * kInvPi);
                v[k] = l > 0.0f ? 1.0f - lane_acos(z[k] / (l > 0.0f ? l : 1.0f)) * kInvPi : 0.0f;
            }
            return;
        case ProjectKind::MirrorBall:
            TALBOT_VECTOR_LOOP
            for (int k = 0; k < n; ++k) {
                const Vec3 d = normalize(Vec3{x[k], y[k], z[k]});
                const float divisor = 2.0f * std::sqrt(maxf(-0.5f * (d.y - 1.0f), 0.0f));
                const float scale = divisor > 0.0f ? 1.0f / divisor : 0.0f;
                u[k] = 0.5f * (d.x * scale + 1.0f);
                v[k] = 0.5f * (d.z * scale + 1.0f);
            }
            return;
    }
}

void op_box_weights(Registers r, int n) {
    // Faces whose share of the normal is largest win; `blend` widens the zones where two or three of them mix.
    Column wx = r[0], wy = r[1], wz = r[2];
    ConstColumn nx = r[3], ny = r[4], nz = r[5], blend_in = r[6];
    TALBOT_VECTOR_LOOP
    for (int k = 0; k < n; ++k) {
        float x = lane_abs(nx[k]), y = lane_abs(ny[k]), z = lane_abs(nz[k]);
        const float sum = x + y + z, scale = sum > 0.0f ? 1.0f / sum : 0.0f;
        x *= scale;
        y *= scale;
        z *= scale;
        const float blend = blend_in[k], limit = 0.5f * (1.0f + blend);
        // As 0 or 1, so that the loop has no branches.
        const auto above = [](float a, float b) { return a > b ? 1.0f : 0.0f; };
        const float only_x = above(x, limit * (x + y)) * above(x, limit * (x + z));
        const float only_y = (1.0f - only_x) * above(y, limit * (x + y)) * above(y, limit * (y + z));
        const float only_z = (1.0f - only_x) * (1.0f - only_y) * above(z, limit * (x + z)) * above(z, limit * (y + z));
        // Two faces mix where the third one's share is small, else all three: the simplex in the middle.
        const float mix_xy = above((1.0f - limit) * (x + y), z);
        const float mix_yz = (1.0f - mix_xy) * above((1.0f - limit) * (y + z), x);
        const float mix_zx = (1.0f - mix_xy) * (1.0f - mix_yz) * above((1.0f - limit) * (x + z), y);
        const float all = 1.0f - mix_xy - mix_yz - mix_zx;
        const auto share = [blend](float a, float b) {
            const float ratio = a / maxf(a + b, 1e-20f);
            return saturate((ratio - 0.5f * (1.0f - blend)) / maxf(blend, 1e-8f));
        };
        const float xy = share(x, y), yz = share(y, z), xz = share(x, z);
        const float divide = all / maxf(2.0f * limit - 1.0f, 1e-8f);
        const float ax = mix_xy * xy + mix_zx * xz + ((2.0f - limit) * x + limit - 1.0f) * divide;
        const float ay = mix_xy * (1.0f - xy) + mix_yz * yz + ((2.0f - limit) * y + limit - 1.0f) * divide;
        const float az = mix_yz * (1.0f - yz) + mix_zx * (1.0f - xz) + ((2.0f - limit) * z + limit - 1.0f) * divide;
        // Without blending nothing is left between the faces but the edges themselves: the x face.
        const float blended = blend > 0.0f ? 1.0f : 0.0f, single = only_x + only_y + only_z;
        wx[k] = only_x + (1.0f - single) * (blended * ax + (1.0f - blended));
        wy[k] = only_y + (1.0f - single) * blended * ay;
        wz[k] = only_z + (1.0f - single) * blended * az;
    }
}

void op_image(const Instruction& i, Registers r, int n, const OpScope& s) {
    const auto interpolation = asset::Interpolation(i.variant >> 2);
    const auto extension = asset::Extension(i.variant & 3);
    static constexpr asset::TextureTable kNoTextures{};
    int32_t handle[kSpan];
    std::memcpy(handle, r[6], size_t(n) * sizeof(float));
    asset::lookup_texture(s.context.textures ? *s.context.textures : kNoTextures, handle, r[4], r[5], s.span.n, interpolation, extension,
                          Columns3{r[0], r[1], r[2]}, r[3]);
    for (int c = 0; c < 4; ++c)
        for (int k = s.span.n; k < n; ++k) r[c][k] = r[c][s.span.n - 1];
}

void op_fresnel(Registers r, int n) {
    // Unpolarised dielectric; total reflection gives 1.
    map2(r, n, [](float cosine, float eta) {
        const float c = lane_abs(cosine);
        const float g2 = eta * eta - 1.0f + c * c;
        const float g = std::sqrt(maxf(g2, 0.0f));
        const float a = (g - c) / (g + c), b = (c * (g + c) - 1.0f) / (c * (g - c) + 1.0f);
        return g2 > 0.0f ? 0.5f * a * a * (1.0f + b * b) : 1.0f;
    });
}

void op_bump(Registers r, int n) {
    // Surface gradient of the height over the footprint [Mikkelsen 2010, "Bump Mapping Unparametrized Surfaces on the GPU"].
    Column x = r[0], y = r[1], z = r[2];
    ConstColumn nx = r[3], ny = r[4], nz = r[5], ux = r[6], uy = r[7], uz = r[8], vx = r[9], vy = r[10], vz = r[11];
    ConstColumn h = r[12], hx = r[13], hy = r[14], strength = r[15], distance = r[16], width = r[17];
    TALBOT_VECTOR_LOOP
    for (int k = 0; k < n; ++k) {
        const Vec3 normal{nx[k], ny[k], nz[k]}, du{ux[k], uy[k], uz[k]}, dv{vx[k], vy[k], vz[k]};
        const Vec3 rx = cross(dv, normal), ry = cross(normal, du);
        const float det = dot(du, rx);
        const Vec3 gradient = rx * (hx[k] - h[k]) + ry * (hy[k] - h[k]);
        const float sign = det < 0.0f ? -1.0f : 1.0f;
        const Vec3 bent = normalize(normal * (width[k] * lane_abs(det)) - gradient * (distance[k] * sign));
        const Vec3 mixed = normalize(lerp(normal, bent, maxf(strength[k], 0.0f)));
        const float l2 = dot(mixed, mixed);
        const bool good = det != 0.0f && l2 > 0.5f && l2 < 2.0f;
        x[k] = good ? mixed.x : normal.x;
        y[k] = good ? mixed.y : normal.y;
        z[k] = good ? mixed.z : normal.z;
    }
}

}  // namespace TALBOT_ISA
}  // namespace talbot::shader
