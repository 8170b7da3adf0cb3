#include "shader/spectra.h"

#include <algorithm>

namespace talbot::shader {
namespace {

constexpr int kSteps = 81;  // 380 to 780 nm in steps of 5 nm

// Colour matching functions of the CIE 1931 2-degree standard observer.
constexpr float kObserver[kSteps][3] = {
    {0.0014f, 0.0000f, 0.0065f}, {0.0022f, 0.0001f, 0.0105f}, {0.0042f, 0.0001f, 0.0201f}, {0.0076f, 0.0002f, 0.0362f}, {0.0143f, 0.0004f, 0.0679f},
    {0.0232f, 0.0006f, 0.1102f}, {0.0435f, 0.0012f, 0.2074f}, {0.0776f, 0.0022f, 0.3713f}, {0.1344f, 0.0040f, 0.6456f}, {0.2148f, 0.0073f, 1.0391f},
    {0.2839f, 0.0116f, 1.3856f}, {0.3285f, 0.0168f, 1.6230f}, {0.3483f, 0.0230f, 1.7471f}, {0.3481f, 0.0298f, 1.7826f}, {0.3362f, 0.0380f, 1.7721f},
    {0.3187f, 0.0480f, 1.7441f}, {0.2908f, 0.0600f, 1.6692f}, {0.2511f, 0.0739f, 1.5281f}, {0.1954f, 0.0910f, 1.2876f}, {0.1421f, 0.1126f, 1.0419f},
    {0.0956f, 0.1390f, 0.8130f}, {0.0580f, 0.1693f, 0.6162f}, {0.0320f, 0.2080f, 0.4652f}, {0.0147f, 0.2586f, 0.3533f}, {0.0049f, 0.3230f, 0.2720f},
    {0.0024f, 0.4073f, 0.2123f}, {0.0093f, 0.5030f, 0.1582f}, {0.0291f, 0.6082f, 0.1117f}, {0.0633f, 0.7100f, 0.0782f}, {0.1096f, 0.7932f, 0.0573f},
    {0.1655f, 0.8620f, 0.0422f}, {0.2257f, 0.9149f, 0.0298f}, {0.2904f, 0.9540f, 0.0203f}, {0.3597f, 0.9803f, 0.0134f}, {0.4334f, 0.9950f, 0.0087f},
    {0.5121f, 1.0000f, 0.0057f}, {0.5945f, 0.9950f, 0.0039f}, {0.6784f, 0.9786f, 0.0027f}, {0.7621f, 0.9520f, 0.0021f}, {0.8425f, 0.9154f, 0.0018f},
    {0.9163f, 0.8700f, 0.0017f}, {0.9786f, 0.8163f, 0.0014f}, {1.0263f, 0.7570f, 0.0011f}, {1.0567f, 0.6949f, 0.0010f}, {1.0622f, 0.6310f, 0.0008f},
    {1.0456f, 0.5668f, 0.0006f}, {1.0026f, 0.5030f, 0.0003f}, {0.9384f, 0.4412f, 0.0002f}, {0.8544f, 0.3810f, 0.0002f}, {0.7514f, 0.3210f, 0.0001f},
    {0.6424f, 0.2650f, 0.0000f}, {0.5419f, 0.2170f, 0.0000f}, {0.4479f, 0.1750f, 0.0000f}, {0.3608f, 0.1382f, 0.0000f}, {0.2835f, 0.1070f, 0.0000f},
    {0.2187f, 0.0816f, 0.0000f}, {0.1649f, 0.0610f, 0.0000f}, {0.1212f, 0.0446f, 0.0000f}, {0.0874f, 0.0320f, 0.0000f}, {0.0636f, 0.0232f, 0.0000f},
    {0.0468f, 0.0170f, 0.0000f}, {0.0329f, 0.0119f, 0.0000f}, {0.0227f, 0.0082f, 0.0000f}, {0.0158f, 0.0057f, 0.0000f}, {0.0114f, 0.0041f, 0.0000f},
    {0.0081f, 0.0029f, 0.0000f}, {0.0058f, 0.0021f, 0.0000f}, {0.0041f, 0.0015f, 0.0000f}, {0.0029f, 0.0010f, 0.0000f}, {0.0020f, 0.0007f, 0.0000f},
    {0.0014f, 0.0005f, 0.0000f}, {0.0010f, 0.0004f, 0.0000f}, {0.0007f, 0.0002f, 0.0000f}, {0.0005f, 0.0002f, 0.0000f}, {0.0003f, 0.0001f, 0.0000f},
    {0.0002f, 0.0001f, 0.0000f}, {0.0002f, 0.0001f, 0.0000f}, {0.0001f, 0.0000f, 0.0000f}, {0.0001f, 0.0000f, 0.0000f}, {0.0001f, 0.0000f, 0.0000f},
    {0.0000f, 0.0000f, 0.0000f}};

}  // namespace

Rgb xyz_to_rec709(double x, double y, double z, Rec709 matrix) {
    static constexpr double kRounded[3][3] = {{3.2404542, -1.5371385, -0.4985314}, {-0.9692660, 1.8760108, 0.0415560}, {0.0556434, -0.2040259, 1.0572252}};
    static constexpr double kExact[3][3] = {
        {3.2409699419, -1.5373831776, -0.4986107603}, {-0.9692436363, 1.8759675015, 0.0415550574}, {0.0556300797, -0.2039769589, 1.0569715142}};
    const auto& m = matrix == Rec709::Exact ? kExact : kRounded;
    const auto row = [&](int i) { return float(m[i][0] * x + m[i][1] * y + m[i][2] * z); };
    return {row(0), row(1), row(2)};
}

Rgb observer_color(int nm, Rec709 matrix) {
    const auto& row = kObserver[std::clamp((nm - 380) / 5, 0, kSteps - 1)];
    return xyz_to_rec709(double(row[0]), double(row[1]), double(row[2]), matrix);
}

namespace {

/// By the matrix of rounded numbers.
Rgb fitted_blackbody(float kelvin) {
    // By temperature from: a / T + b T + c for red and green, a cubic for blue. Fitted to what Cycles gives, to 4e-7.
    struct Segment {
        double from, red[3], green[3], blue[4];
    };
    static constexpr Segment kSegments[] = {
        {800, {1619.1839, -2.05011972e-3, 5.02997521}, {0, 0, 0}, {0, 0, 0, 0}},
        {965, {2488.44689, -1.11331732e-3, 3.22623145}, {-755.99413, 3.16730218e-4, 0.478305879}, {0, 0, 0, 0}},
        {1167, {3341.44264, -4.86545486e-4, 1.76485196}, {-1023.64409, 1.20220943e-4, 0.93666894}, {0, 0, 0, 0}},
        {1449, {4094.62045, -1.27445197e-4, 0.725727522}, {-1265.7129, 4.8734275e-6, 1.27054483}, {0, 0, 0, 0}},
        {1902,
         {4670.28509, 2.91265188e-5, 0.126699724},
         {-1425.29413, -4.01151703e-5, 1.43972844},
         {-1.97076132e-11, 1.75359644e-7, -2.50543602e-4, -0.022277651}},
        {3315,
         {4595.09183, 2.87495691e-5, 0.150345008},
         {-1175.54802, -2.1637804e-5, 1.3040802},
         {-1.62057105e-13, -1.64207309e-8, 3.86212104e-4, -0.738070878}},
        {6365,
         {3787.1769, 9.35910773e-6, 0.399075336},
         {-500.800332, -4.59832788e-6, 1.09098783},
         {6.72644707e-13, -2.73077266e-8, 4.24096839e-4, -0.752331338}},
    };
    if (kelvin < kBlackbodyCold) return {5.413294f, 0, 0};
    if (kelvin >= kBlackbodyHot) return {0.8262955f, 0.994508f, 1.566308f};
    const double t = double(kelvin);
    const Segment* s = kSegments;
    for (const Segment& next : kSegments)
        if (t >= next.from) s = &next;
    const auto hyperbola = [&](const double(&k)[3]) { return float(std::max(k[0] / t + k[1] * t + k[2], 0.0)); };
    const double blue = ((s->blue[0] * t + s->blue[1]) * t + s->blue[2]) * t + s->blue[3];
    return {hyperbola(s->red), hyperbola(s->green), float(std::max(blue, 0.0))};
}

}  // namespace

Rgb blackbody_color(float kelvin, Rec709 matrix) {
    const Rgb fit = fitted_blackbody(kelvin);
    // Product of the exact matrix and the inverse of the rounded one; what is off its diagonal is below 1e-7.
    return matrix == Rec709::Exact ? fit * Rgb{1.00015915f, 0.999976919f, 0.99976005f} : fit;
}

std::vector<Rgb> blackbody_table(Rec709 matrix) {
    constexpr int n = 4096;
    std::vector<Rgb> table;
    for (int i = 0; i < n; ++i) {
        const double inverse = 1.0 / double(kBlackbodyHot) + (1.0 / double(kBlackbodyCold) - 1.0 / double(kBlackbodyHot)) * i / (n - 1);
        // Even steps of 1/T; the ends stand for all that is hotter or colder.
        table.push_back(blackbody_color(i == 0 ? kBlackbodyHot : i == n - 1 ? 0.0f : float(1.0 / inverse), matrix));
    }
    return table;
}

std::vector<Rgb> wavelength_table(Rec709 matrix) {
    std::vector<Rgb> table;
    table.push_back({});
    for (int nm = 380; nm <= 780; nm += 5) {
        const Rgb c = observer_color(nm, matrix) * (1.0f / 2.52f);
        table.push_back({std::max(c.x, 0.0f), std::max(c.y, 0.0f), std::max(c.z, 0.0f)});
    }
    table.push_back({});
    return table;
}

}  // namespace talbot::shader
