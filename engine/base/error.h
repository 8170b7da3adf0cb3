/// Errors and reports. Building or updating a scene may throw `Error`; stages cannot fail: what they could not do right
/// goes into a `Report`, one line per kind and place. The library never prints, exits or aborts.
#pragma once

#include <exception>
#include <mutex>
#include <string>
#include <vector>

namespace talbot {

/// What went wrong, and where in Blender's names ("Material 'Glass' > node 'Noise Texture' > socket 'Scale'").
class Error : public std::exception {
public:
    explicit Error(std::string what, std::string where = {});
    const char* what() const noexcept override { return text_.c_str(); }
    const std::string& where() const { return where_; }

private:
    std::string where_;
    std::string text_;
};

/// The user's cancel, thrown through building code and caught by the session.
struct Cancelled {};

struct ReportLine {
    enum class Level { Info, Warning, Error } level = Level::Warning;
    std::string text;
    std::string where;  ///< Blender names, may be empty
    int count = 1;      ///< how often the same text and place was reported
};

/// Thread-safe list of lines; equal lines are counted, not repeated.
class Report {
public:
    void info(const std::string& text, const std::string& where = {}) { add(ReportLine::Level::Info, text, where); }
    void warning(const std::string& text, const std::string& where = {}) { add(ReportLine::Level::Warning, text, where); }
    void error(const std::string& text, const std::string& where = {}) { add(ReportLine::Level::Error, text, where); }
    std::vector<ReportLine> lines() const;
    void clear();

private:
    void add(ReportLine::Level level, const std::string& text, const std::string& where);
    mutable std::mutex mutex_;
    std::vector<ReportLine> lines_;
};

}  // namespace talbot
