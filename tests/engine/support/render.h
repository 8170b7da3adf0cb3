/// A scene rendered to its end, for tests of the loop as a whole.
#pragma once

#include <gtest/gtest.h>

#include <utility>
#include <vector>

#include "session/session.h"

namespace talbot::tests {

/// One pass, channels innermost; a render that fails is a failure of the test.
inline std::vector<float> rendered(scene::Scene scene, scene::PassKind kind = scene::PassKind::Combined) {
    Session session;
    session.edit() = std::move(scene);
    session.start();
    while (!session.wait(1000)) {
    }
    EXPECT_EQ(session.progress().state, SessionState::Done) << session.error();
    std::vector<float> pixels;
    EXPECT_TRUE(session.read_pass(kind, pixels));
    return pixels;
}

}  // namespace talbot::tests
