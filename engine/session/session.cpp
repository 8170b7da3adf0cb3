#include "session/session.h"

#include <algorithm>
#include <span>

#include "session/state.h"

namespace talbot {

namespace {

bool is_running(SessionState state) {
    return state == SessionState::Updating || state == SessionState::Rendering || state == SessionState::Paused;
}

/// The newest picture, as resolve(film, where to) gives it. Of a coarse preview each pixel covers a block.
void read_film(const Session::State& s, size_t channels, std::vector<float>& out, auto&& resolve) {
    out.resize(size_t(s.width) * size_t(s.height) * channels);
    if (!s.coarse) return resolve(*s.film, out);
    std::vector<float> blocks(size_t(s.coarse->width()) * size_t(s.coarse->height()) * channels);
    resolve(*s.coarse, blocks);
    for (int y = 0; y < s.height; ++y) {
        for (int x = 0; x < s.width; ++x) {
            const size_t from = (size_t(y / s.coarse_size) * size_t(s.coarse->width()) + size_t(x / s.coarse_size)) * channels;
            std::copy_n(&blocks[from], channels, &out[(size_t(y) * size_t(s.width) + size_t(x)) * channels]);
        }
    }
}

std::vector<float> resolve(const film::Film& film, scene::PassKind kind, const scene::Settings& settings) {
    std::vector<float> pixels;
    if (film.layout().has(kind)) {
        pixels.resize(size_t(film.width()) * size_t(film.height()) * size_t(film::pass_channels(kind)));
        film.resolve(kind, settings, pixels);
    }
    return pixels;
}

/// The whole film, on the controller's thread: whoever looks at the picture goes on, and a cancel ends it.
void denoise(Session::State& s) {
    s.set_status(SessionState::Rendering, "Denoising");
    const scene::Settings& settings = s.scene.settings;
    std::vector<float> rgba = resolve(*s.film, scene::PassKind::Combined, settings);
    const std::vector<float> albedo = resolve(*s.film, scene::PassKind::DenoisingAlbedo, settings);
    const std::vector<float> normal = resolve(*s.film, scene::PassKind::DenoisingNormal, settings);
    std::vector<float> color(rgba.size() / 4 * 3);
    for (size_t i = 0; i < rgba.size() / 4; ++i) std::copy_n(&rgba[i * 4], 3, &color[i * 3]);
    const film::DenoiseResult result = film::denoise(color, albedo, normal, s.width, s.height, s.data.pool->size(), *s.denoiser, &s.cancel);
    if (s.cancel) throw Cancelled{};
    if (!result.ok) {
        s.report.warning(result.message);
        return;
    }
    for (size_t i = 0; i < rgba.size() / 4; ++i) std::copy_n(&color[i * 3], 3, &rgba[i * 4]);
    std::lock_guard lock(s.mutex);
    s.denoised = std::move(rgba);
    s.progress.image_version++;
}

void control(Session::State& s) {
    FlushDenormals flush;
    SessionState end = SessionState::Done;
    std::string status = "Done", error;
    try {
        update_render_data(s);
        render_samples(s);
        if (s.denoiser) denoise(s);
    } catch (const Cancelled&) {
        end = SessionState::Cancelled;
        status = "Cancelled";
    } catch (const std::bad_alloc&) {
        end = SessionState::Failed;
        error = "Out of memory";
    } catch (const std::exception& e) {
        end = SessionState::Failed;
        error = e.what();
    }
    if (end == SessionState::Failed) status = error;
    std::lock_guard lock(s.mutex);
    s.error = error;
    s.progress.state = end;
    s.progress.status = status;
    s.progress.seconds = seconds_since(s.started);
    if (end == SessionState::Done) s.progress.fraction = 1;
    s.progress.remaining = 0;
    s.changed.notify_all();
}

}  // namespace

void Session::State::set_status(SessionState state, const std::string& status) {
    std::lock_guard lock(mutex);
    progress.state = state;
    progress.status = status;
}

Session::Session() : state_(std::make_unique<State>()) {}

Session::~Session() {
    stop();
}

scene::Scene& Session::edit() {
    stop();
    return state_->scene;
}

void Session::start() {
    stop();
    State& s = *state_;
    s.cancel = false;
    s.paused = false;
    s.started = Clock::now();
    {
        std::lock_guard lock(s.mutex);
        const uint64_t version = s.progress.image_version;
        const size_t peak = s.progress.memory_peak;
        s.progress = {};
        s.progress.state = SessionState::Updating;
        s.progress.status = "Updating";
        s.progress.image_version = version;
        s.progress.memory_peak = peak;
        s.progress.samples_total = s.scene.settings.samples;
        s.error.clear();
        s.denoised.clear();
    }
    s.report.clear();
    s.controller = std::thread([&s] { control(s); });
}

bool Session::wait(int milliseconds) {
    State& s = *state_;
    std::unique_lock lock(s.mutex);
    return s.changed.wait_for(lock, std::chrono::milliseconds(milliseconds), [&] { return !is_running(s.progress.state); });
}

void Session::cancel() {
    state_->cancel = true;
}

void Session::stop() {
    state_->cancel = true;
    if (state_->controller.joinable()) state_->controller.join();
}

void Session::pause(bool paused) {
    state_->paused = paused;
}

Progress Session::progress() const {
    const State& s = *state_;
    std::lock_guard lock(s.mutex);
    Progress p = s.progress;
    if (is_running(p.state)) p.seconds = seconds_since(s.started);
    if (p.state == SessionState::Rendering && s.paused) p.state = SessionState::Paused;
    return p;
}

Statistics Session::statistics() const {
    std::lock_guard lock(state_->mutex);
    return state_->statistics;
}

std::string Session::error() const {
    std::lock_guard lock(state_->mutex);
    return state_->error;
}

Report& Session::report() {
    return state_->report;
}

int Session::width() const {
    std::lock_guard lock(state_->mutex);
    return state_->width;
}

int Session::height() const {
    std::lock_guard lock(state_->mutex);
    return state_->height;
}

bool Session::read_pass(scene::PassKind kind, std::vector<float>& out) const {
    const State& s = *state_;
    std::lock_guard lock(s.mutex);
    if (!s.film || !s.film->layout().has(kind)) return false;
    read_film(s, size_t(film::pass_channels(kind)), out, [&](const film::Film& film, std::span<float> to) { film.resolve(kind, s.scene.settings, to); });
    return true;
}

bool Session::read_aov(const scene::Aov& aov, std::vector<float>& out) const {
    const State& s = *state_;
    std::lock_guard lock(s.mutex);
    const auto found = std::find(s.scene.aovs.begin(), s.scene.aovs.end(), aov);
    if (!s.film || s.film->layout().aovs < 0 || found == s.scene.aovs.end()) return false;
    const size_t index = size_t(found - s.scene.aovs.begin());
    read_film(s, aov.is_color ? 4 : 1, out, [&](const film::Film& film, std::span<float> to) { film.resolve_aov(index, aov.is_color, to); });
    return true;
}

bool Session::read_light_group(const std::string& name, std::vector<float>& out) const {
    const State& s = *state_;
    std::lock_guard lock(s.mutex);
    const auto found = std::find(s.scene.light_groups.begin(), s.scene.light_groups.end(), name);
    if (!s.film || s.film->layout().light_groups < 0 || found == s.scene.light_groups.end()) return false;
    const size_t index = size_t(found - s.scene.light_groups.begin());
    read_film(s, 3, out, [&](const film::Film& film, std::span<float> to) { film.resolve_light_group(index, s.scene.settings, to); });
    return true;
}

void Session::set_denoiser(const std::vector<std::string>* library_dirs) {
    stop();
    if (library_dirs)
        state_->denoiser = *library_dirs;
    else
        state_->denoiser.reset();
}

bool Session::read_denoised(std::vector<float>& rgba_out) const {
    std::lock_guard lock(state_->mutex);
    rgba_out = state_->denoised;
    return !rgba_out.empty();
}

}  // namespace talbot
