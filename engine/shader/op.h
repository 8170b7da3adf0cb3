/// The operations of node programs: one enumerator a loop (or a family of loops that `variant` picks from). All operands are
/// scalars: a vector is three of them, so taking components apart and putting them together costs nothing. Each line below lists the operands in -> out.
/// Families live in kernels/ops_*.cpp; the only switch over `Op` is in kernels/interpreter.cpp.
///
/// "bits" marks an operand that holds an integer in a float column (handles, table offsets, counts).
#pragma once

#include <cstdint>

namespace talbot::shader {

enum class Op : uint16_t {
    Literal,   ///< -> x. data: the 32 bits. Part of the program
    Constant,  ///< -> x. data: k; lane i reads constants[span.constants[i] + k]. Part of the material
    Copy,      ///< a -> x
    Unary,     ///< a -> x. variant: UnaryKind
    Binary,    ///< a, b -> x. variant: BinaryKind
    Ternary,   ///< a, b, c -> x. variant: TernaryKind
    Vector,    ///< up to 10 -> 3 (or 1). variant: VectorKind

    // What the shading point is. Not foldable.
    Input,              ///< -> x. variant: InputColumn
    ObjectTransform,    ///< vector -> vector by the lane's object or lamp (background: unchanged). variant: TransformKind, | kNotOfLamps
    CameraTransform,    ///< vector -> vector. variant: TransformKind with the camera in the object's place, +Z forward (panoramas: +X, and +Y
                        ///< to the left), and kAroundBackground, kAroundLamps
    Affine,             ///< 12 matrix entries, vector -> vector. variant: 0 point, 1 vector, 2 normal (matrix = inverse of the points' map). Foldable
    Window,             ///< world position -> x, y of the film in 0..1. variant: 1 fisheyes (equidistant, equisolid) are mirrored, | kAroundLamps
    Attribute,          ///< u, v -> 4 components, and what a number reads of them. data: attribute id; variant: AttributeSource
    Generated,          ///< u, v, object position -> vector. data: id of "@generated"; variant: 1 curves and points that have none say their world position
    VertexNormal,       ///< u, v -> interpolated unnormalised object-space normal (geometric on flat faces), facing the front side
    ObjectValue,        ///< -> x. variant: ObjectField; data: OfLamps
    Instancer,          ///< -> 5: dupli generated (3), dupli uv (2)
    ShiftBarycentrics,  ///< world offset vector -> u', v'
    CurveTangent,  ///< -> unit vector along the curve from its root, world space; elsewhere what the variant, a NoCurve, says: FirstEdge and LastEdge are the
                   ///< triangle's, Given is the operand (a vector), but zero on points

    // Colour
    Blend,          ///< factor, a rgb, b rgb -> rgb. variant: BlendKind
    ColorConvert,   ///< 3 -> 3. variant: ConvertKind
    HueSaturation,  ///< hue, saturation, value, factor, rgb -> rgb. variant: 1 hues below 0 stay there
    Ramp,           ///< factor, offset bits, count bits -> rgba. variant: 1 constant interpolation
    Curve,          ///< x, offset bits, count bits, min, 1/(max - min) -> y. variant: 1 extrapolate
    Curves,         ///< r, g, b, offset bits, count bits, min, 1/(max - min) -> rgb, each by its own curve, one table after another. variant: 1 extrapolate
    Lookup,         ///< x, offset bits, min, steps/(max - min) -> rgb, between equal steps, held at the ends; four floats a step. data: number of steps

    // Textures
    Project,       ///< vector -> u, v. variant: ProjectKind
    BoxWeights,    ///< normal, blend, -> 3 weights
    Image,         ///< u, v, handle bits -> rgba. variant: interpolation * 4 + extension. Not foldable
    Noise,         ///< x, y, z, w, detail, roughness, lacunarity, offset, gain -> fac. variant: noise_variant
    SignedNoise,   ///< x, y, z, w -> signed Perlin. variant: noise_variant
    Voronoi,       ///< x, y, z, w, smoothness, exponent, randomness -> distance, rgb, position xyzw. variant: voronoi_variant; data: kVoronoi... bits
    Gabor,         ///< x, y, z (scaled), frequency, anisotropy, orientation (2D: angle, -, -; 3D: unit vector) -> value, phase, intensity. variant: dimensions
    WhiteNoise,    ///< x, y, z, w -> value, r, g, b. variant: dimensions
    Wave,          ///< x, y, z (scaled), phase (distortion included) -> fac. variant: wave_variant
    Magic,         ///< x, y, z, scale, distortion -> rgb. variant: depth
    Brick,         ///< x, y, z, scale, mortar size, mortar smooth, bias, width, height, offset, squash -> tint, mortar. data: frequencies (offset, squash);
                   ///< variant 1: a negative smoothness leaves no mortar
    Checker,       ///< x, y, z (scaled) -> 0 or 1
    Gradient,      ///< x, y, z -> fac. variant: GradientKind
    RadialTiling,  ///< x, y, sides, roundness -> parameter along the side, distance, id, width, rotation. variant: 1 normalised
    Ies,           ///< horizontal and vertical angle, offset bits -> intensity. variant: IesEnds. Table: counts, angles, values by
                   ///< horizontal angle
    Grid,          ///< u, v, offset bits -> rgb, bilinear between the middles of cells, held at the edges. data: width << 16 | height

    // Surface
    Fresnel,      ///< cosine, eta -> reflectance
    Bump,         ///< normal, dP/dx, dP/dy, h, hx, hy, strength, distance, filter width -> normal
    Wireframe,    ///< size, p -> 1 near an edge of the triangle. variant: 1 size in pixels. Not foldable
    Occlusion,    ///< normal, distance -> unoccluded share. variant: 1 inside | 2 own object only; data: samples, salt << 8. Not foldable
    Bevel,        ///< radius -> normal. data: samples, salt << 8. Not foldable
    Raycast,      ///< origin, direction, length -> hit, hit on the own object, distance, position, normal, object bits (-1: none), primitive bits, u, v.
                  ///< variant: 1 own object only. Not foldable
    AttributeAt,  ///< object bits, primitive bits, u, v -> as Attribute, 0 where there is no object. data: attribute id. Not foldable
    Random,       ///< -> u, v. data: dimension salt. Not foldable

    // Closure parameters: kernels/ops_closure*.cpp
    Closure,  ///< variant: ClosureOp (ops_closure.h); operands by variant. Foldable
};

enum class UnaryKind : uint8_t {
    Absolute,
    Negate,
    SquareRoot,
    InverseSquareRoot,
    Exponent,
    Sine,
    Cosine,
    Tangent,
    ArcSine,
    ArcCosine,
    ArcTangent,
    HyperbolicSine,
    HyperbolicCosine,
    HyperbolicTangent,
    Floor,
    Ceil,
    Truncate,
    Round,
    Fraction,
    Sign,
    Saturate,
    OneMinus,
    Reciprocal,  ///< 1/0 = 0
    Sanitize,    ///< NaN and infinities become 0
};

enum class BinaryKind : uint8_t {
    Add,
    Subtract,
    Multiply,
    Divide,  ///< by 0: 0
    Power,   ///< lane_safe_pow
    Logarithm,
    Minimum,
    Maximum,
    LessThan,
    GreaterThan,
    Modulo,  ///< truncated
    FlooredModulo,
    Snap,
    PingPong,
    ArcTangent2,
    GammaPower,  ///< of positive bases only, others pass
};

enum class TernaryKind : uint8_t {
    MultiplyAdd,  ///< a b + c
    Lerp,         ///< a + (b - a) c
    Clamp,        ///< a to [b, c]
    ClampRange,   ///< the same, bounds in any order
    Select,       ///< a != 0 ? b : c
    Compare,      ///< |a - b| <= max(c, epsilon)
    SmoothMinimum,
    SmoothMaximum,
    Wrap,  ///< a into [c, b)
};

enum class VectorKind : uint8_t {
    Dot,          ///< 6 -> 1
    Length,       ///< 3 -> 1
    Normalize,    ///< 3 -> 3
    Cross,        ///< 6 -> 3
    Project,      ///< 6 -> 3
    Reflect,      ///< 6 -> 3
    Refract,      ///< 7 -> 3
    FaceForward,  ///< 9 -> 3
    RotateAxis,   ///< vector, axis, angle -> 3
    EulerMatrix,  ///< xyz angles -> 9, row-major, X first
    Basis,        ///< unit normal -> two unit vectors that make it a right-handed frame, those of Cycles' ray differentials (3 -> 6)
    SafeNormal,   ///< vector, fallback -> unit vector; the fallback where the vector is zero or not finite
};

/// Columns of the span. Booleans and integers arrive as floats 0, 1, 2...
enum class InputColumn : uint8_t {
    PositionX,
    PositionY,
    PositionZ,
    NormalX,
    NormalY,
    NormalZ,
    GeometricX,
    GeometricY,
    GeometricZ,
    IncomingX,
    IncomingY,
    IncomingZ,
    BarycentricU,
    BarycentricV,
    RayLength,
    Footprint,
    Backfacing,
    IsCamera,
    IsDiffuse,
    IsGlossy,
    IsTransmission,
    IsReflection,
    IsSingular,
    IsShadow,
    IsVolumeScatter,
    Depth,
    DiffuseDepth,
    GlossyDepth,
    TransparentDepth,
    TransmissionDepth,
    IsBackground,
    IsLamp,
};

enum class TransformKind : uint8_t { PointToObject, VectorToObject, NormalToObject, PointToWorld, VectorToWorld, NormalToWorld };
inline constexpr uint8_t kNotOfLamps = 8;         ///< lamps have no space of their own
inline constexpr uint8_t kAroundBackground = 16;  ///< Op::CameraTransform: a background is seen from its middle
inline constexpr uint8_t kAroundLamps = 32;       ///< Op::CameraTransform and Op::Window: what is on a lamp, too, wherever the camera stands
enum class AttributeSource : uint8_t {
    Geometry,
    Object,
    OpaqueGeometry,  ///< Geometry, but alpha is 1 where there is no such attribute
    Property,        ///< Object, but alpha is 1 where there is no object
    PropertyOrLamp,  ///< Property, but lamps are objects
};
/// Of lamps an operation reads what its data says.
enum class OfLamps : uint32_t { Nothing, Random, All };
enum class ObjectField : uint8_t {
    LocationX,
    LocationY,
    LocationZ,
    ColorR,
    ColorG,
    ColorB,
    Alpha,
    Index,
    Random,
    NegativeScale,
    Smooth,
    MeanScale,
    AppliedScale,
    IsCurve,
    IsRibbon,
    IsPoint
};

enum class BlendKind : uint8_t {
    Mix,
    Darken,
    Multiply,
    Burn,
    Lighten,
    Screen,
    Dodge,
    Add,
    Overlay,
    SoftLight,
    LinearLight,
    Difference,
    Exclusion,
    Subtract,
    Divide,
    Hue,
    Saturation,
    Color,
    Value,
};
enum class ConvertKind : uint8_t { RgbToHsv, HsvToRgb, RgbToHsl, HslToRgb };
enum class NoCurve : uint8_t { Zero, FirstEdge, LastEdge, Given };
enum class ProjectKind : uint8_t { Sphere, Tube, Equirectangular, MirrorBall };
/// What IES tables read beyond their ends, below the first vertical angle of 0 excepted: the other end's values horizontally, zeros, or the end's own value.
enum class IesEnds : uint8_t { Wrap, Zero, Stay };
enum class GradientKind : uint8_t { Linear, Quadratic, Easing, Diagonal, Spherical, QuadraticSphere, Radial };

/// Bits of Noise and SignedNoise variants.
enum class NoiseKind : uint8_t { Fbm, Multifractal, RidgedMultifractal, HybridMultifractal, HeteroTerrain };
inline constexpr uint8_t noise_variant(int dimensions, NoiseKind kind, bool normalize, bool wrap) {
    return uint8_t((dimensions - 1) | (int(kind) << 2) | (normalize ? 32 : 0) | (wrap ? 64 : 0));
}

enum class VoronoiFeature : uint8_t { F1, F2, SmoothF1, DistanceToEdge, NSphereRadius };
enum class VoronoiMetric : uint8_t { Euclidean, Manhattan, Chebychev, Minkowski };
inline constexpr uint8_t voronoi_variant(int dimensions, VoronoiFeature feature, VoronoiMetric metric) {
    return uint8_t((dimensions - 1) | (int(feature) << 2) | (int(metric) << 5));
}

/// Bits of Voronoi's data.
inline constexpr uint32_t kVoronoiIntegerHash = 1;  ///< cells are hashed by their numbers, not by the bits of floats
inline constexpr uint32_t kVoronoiNoColor = 2;      ///< nobody asks for rgb: zeros
inline constexpr uint32_t kVoronoiNoPosition = 4;   ///< nor for the position

enum class WaveProfile : uint8_t { Sine, Saw, Triangle };
/// Axis: 0 x, 1 y, 2 z, 3 diagonal or spherical.
inline constexpr uint8_t wave_variant(bool rings, int axis, WaveProfile profile) {
    return uint8_t((rings ? 1 : 0) | (axis << 1) | (int(profile) << 3));
}

/// True when the result depends on the operands (and tables) alone.
inline constexpr bool is_foldable(Op op) {
    switch (op) {
        case Op::Constant:
        case Op::Input:
        case Op::ObjectTransform:
        case Op::CameraTransform:
        case Op::Window:
        case Op::Attribute:
        case Op::Generated:
        case Op::VertexNormal:
        case Op::ObjectValue:
        case Op::Instancer:
        case Op::ShiftBarycentrics:
        case Op::CurveTangent:
        case Op::Image:
        case Op::Wireframe:
        case Op::Occlusion:
        case Op::Bevel:
        case Op::Raycast:
        case Op::AttributeAt:
        case Op::Random:
            return false;
        default:
            return true;
    }
}

}  // namespace talbot::shader
