#include "base/error.h"

namespace talbot {

Error::Error(std::string what, std::string where) : where_(std::move(where)) {
    text_ = where_.empty() ? std::move(what) : where_ + ": " + what;
}

std::vector<ReportLine> Report::lines() const {
    std::lock_guard lock(mutex_);
    return lines_;
}

void Report::clear() {
    std::lock_guard lock(mutex_);
    lines_.clear();
}

void Report::add(ReportLine::Level level, const std::string& text, const std::string& where) {
    std::lock_guard lock(mutex_);
    for (ReportLine& line : lines_) {
        if (line.level == level && line.text == text && line.where == where) {
            ++line.count;
            return;
        }
    }
    lines_.push_back({level, text, where, 1});
}

}  // namespace talbot
