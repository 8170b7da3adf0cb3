// Lane maths against long double: the bounds that base/math.h states, at many points and at the corners.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include "base/math.h"

namespace talbot {
namespace {

constexpr double kU = 1.0 / 16777216.0;

struct Range {
    double lo, hi;
    bool logarithmic = false;
};

// Worst error in units of u = 2^-24 over 200,001 points.
double worst(Range range, const std::function<float(float)>& f, const std::function<long double(long double)>& exact, bool relative) {
    double bad = 0;
    const int n = 200001;
    for (int i = 0; i < n; ++i) {
        const double t = double(i) / (n - 1);
        const float x = float(range.logarithmic ? range.lo * std::pow(range.hi / range.lo, t) : range.lo + (range.hi - range.lo) * t);
        const long double e = exact(x);
        double error = double(std::fabs((long double)f(x) - e));
        if (relative) error /= double(std::fabs(e)) + 1e-37;
        if (!(error < 1e30)) return 1e30;
        bad = std::max(bad, error);
    }
    return bad / kU;
}

#define TALBOT_F(name) [](float x) { return name(x); }
#define TALBOT_L(name) [](long double x) { return std::name(x); }

TEST(Math, ExponentialsAndLogarithms) {
    EXPECT_LT(worst({-125, 127.9}, TALBOT_F(lane_exp2), TALBOT_L(exp2), true), 3);
    EXPECT_LT(worst({-1, 1}, TALBOT_F(lane_exp2), TALBOT_L(exp2), true), 3);
    EXPECT_LT(worst({-87, 88.7}, TALBOT_F(lane_exp), TALBOT_L(exp), true), 3.5);
    EXPECT_LT(worst({1e-37, 1e38, true}, TALBOT_F(lane_log2), TALBOT_L(log2), true), 4.5);
    EXPECT_LT(worst({0.5, 2.0}, TALBOT_F(lane_log2), TALBOT_L(log2), true), 4.5);
    EXPECT_LT(worst({1e-37, 1e38, true}, TALBOT_F(lane_log), TALBOT_L(log), true), 3.5);
    EXPECT_LT(worst({0.5, 2.0}, TALBOT_F(lane_log), TALBOT_L(log), true), 3.5);
    EXPECT_EQ(lane_exp2(0), 1);
    EXPECT_EQ(lane_exp2(10), 1024);
    EXPECT_EQ(lane_exp2(-1000), 0);
    EXPECT_EQ(lane_exp(-1000), 0);
    EXPECT_TRUE(std::isinf(lane_exp2(1000)));
    EXPECT_TRUE(std::isinf(lane_exp(1000)));
    EXPECT_EQ(lane_log(1), 0);
    EXPECT_EQ(lane_log2(8), 3);
    EXPECT_TRUE(std::isfinite(lane_log(0)) && std::isfinite(lane_log(-1)));
}

TEST(Math, Powers) {
    for (float y : {-3.0f, -0.5f, 0.3f, 1.0f, 2.2f, 5.0f}) {
        for (double x = 1e-6; x < 1e6; x *= 1.37) {
            const long double e = std::pow((long double)float(x), (long double)y);
            const double bound = (4 + 4 * std::fabs(y * std::log2(x))) * kU;
            EXPECT_LT(std::fabs(double(lane_pow(float(x), y) / e - 1)), bound) << x << " ^ " << y;
        }
    }
    EXPECT_EQ(lane_safe_pow(0, 0), 1);
    EXPECT_EQ(lane_safe_pow(0, 2), 0);
    EXPECT_EQ(lane_safe_pow(0, -2), 0);
    EXPECT_NEAR(lane_safe_pow(-2, 3), -8, 1e-5);
    EXPECT_NEAR(lane_safe_pow(-2, 2), 4, 1e-5);
    EXPECT_EQ(lane_safe_pow(-2, 0.5f), 0);
}

TEST(Math, Trigonometry) {
    for (double r : {1.0, 10.0, 1000.0, 1e5}) {
        EXPECT_LT(worst({-r, r}, TALBOT_F(lane_sin), TALBOT_L(sin), false), 2) << r;
        EXPECT_LT(worst({-r, r}, TALBOT_F(lane_cos), TALBOT_L(cos), false), 2) << r;
    }
    EXPECT_LT(worst({-1.5, 1.5}, TALBOT_F(lane_tan), TALBOT_L(tan), true), 5);
    EXPECT_LT(worst({1e-30, 1e-3, true}, TALBOT_F(lane_sin), TALBOT_L(sin), true), 2);
    for (float x : {1e6f, -3e8f, 1e30f, std::numeric_limits<float>::infinity(), std::numeric_limits<float>::quiet_NaN()}) {
        EXPECT_LE(std::fabs(lane_sin(x)), 1) << x;
        EXPECT_LE(std::fabs(lane_cos(x)), 1) << x;
    }
    EXPECT_EQ(lane_sin(0), 0);
    EXPECT_EQ(lane_cos(0), 1);
}

TEST(Math, InverseTrigonometry) {
    EXPECT_LT(worst({-1, 1}, TALBOT_F(lane_asin), TALBOT_L(asin), true), 5);
    EXPECT_LT(worst({-1, 0.999}, TALBOT_F(lane_acos), TALBOT_L(acos), false), 6);
    EXPECT_LT(worst({0.5, 0.9999999}, TALBOT_F(lane_acos), TALBOT_L(acos), true), 3);
    EXPECT_LT(worst({-4, 4}, TALBOT_F(lane_atan), TALBOT_L(atan), true), 3.5);
    EXPECT_LT(worst({1e-30, 1e30, true}, TALBOT_F(lane_atan), TALBOT_L(atan), true), 3.5);
    for (int i = 0; i < 3600; ++i) {
        const double a = (i - 1800) * kPi / 1800 * 0.9999, r = std::exp2(i % 40 - 20);
        const float y = float(r * std::sin(a)), x = float(r * std::cos(a));
        EXPECT_NEAR(lane_atan2(y, x), std::atan2(y, x), 5e-7);
    }
    EXPECT_EQ(lane_atan2(0, 0), 0);
    EXPECT_FLOAT_EQ(lane_atan2(0, -1), kPi);
    EXPECT_FLOAT_EQ(lane_acos(-2), kPi);
    EXPECT_FLOAT_EQ(lane_asin(7), kHalfPi);
    EXPECT_EQ(lane_acos(1), 0);
}

TEST(Math, Hyperbolics) {
    EXPECT_LT(worst({-20, 20}, TALBOT_F(lane_sinh), TALBOT_L(sinh), true), 10);
    EXPECT_LT(worst({-20, 20}, TALBOT_F(lane_cosh), TALBOT_L(cosh), true), 10);
    EXPECT_LT(worst({-20, 20}, TALBOT_F(lane_tanh), TALBOT_L(tanh), true), 10);
}

TEST(Math, Rounding) {
    EXPECT_EQ(lane_round(2.5f), 3);
    EXPECT_EQ(lane_round(-2.5f), -2);
    EXPECT_EQ(lane_floor(-0.25f), -1);
    EXPECT_EQ(lane_fract(-0.25f), 0.75f);
    EXPECT_EQ(lane_sign(-3), -1);
    EXPECT_EQ(lane_sign(0), 0);
    EXPECT_EQ(lane_int(3e9f), 2147483520);
    EXPECT_EQ(lane_int(-3e9f), -2147483647 - 1);
    EXPECT_EQ(lane_int(-1.9f), -1);
}

}  // namespace
}  // namespace talbot
