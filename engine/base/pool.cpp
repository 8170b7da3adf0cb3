#include "base/pool.h"

#include <atomic>
#include <exception>

#if defined(__x86_64__)
#include <xmmintrin.h>
#endif

namespace talbot {

FlushDenormals::FlushDenormals() {
#if defined(__x86_64__)
    saved_ = _mm_getcsr();
    _mm_setcsr(saved_ | 0x8040);  // FTZ | DAZ
#endif
}

FlushDenormals::~FlushDenormals() {
#if defined(__x86_64__)
    _mm_setcsr(saved_);
#endif
}

WorkerPool::WorkerPool(int threads) {
    int n = threads > 0 ? threads : int(std::thread::hardware_concurrency());
    if (n < 1) n = 1;
    threads_.reserve(size_t(n));
    for (int i = 0; i < n; ++i) threads_.emplace_back([this, i] { worker_main(i); });
}

WorkerPool::~WorkerPool() {
    {
        std::lock_guard lock(mutex_);
        stop_ = true;
    }
    wake_.notify_all();
    for (std::thread& t : threads_) t.join();
}

void WorkerPool::run(const std::function<void(int)>& job) {
    std::lock_guard one(run_mutex_);
    std::unique_lock lock(mutex_);
    job_ = &job;
    running_ = size();
    failure_ = nullptr;
    ++generation_;
    wake_.notify_all();
    done_.wait(lock, [this] { return running_ == 0; });
    job_ = nullptr;
    if (failure_) std::rethrow_exception(failure_);
}

void WorkerPool::parallel_for(size_t n, size_t grain, const std::function<void(size_t, size_t, int)>& job) {
    if (n == 0) return;
    if (grain == 0) grain = 1;
    std::atomic<size_t> next{0};
    run([&](int worker) {
        for (;;) {
            const size_t begin = next.fetch_add(grain, std::memory_order_relaxed);
            if (begin >= n) return;
            job(begin, begin + grain < n ? begin + grain : n, worker);
        }
    });
}

void WorkerPool::worker_main(int worker) {
    FlushDenormals flush;
    uint64_t seen = 0;
    std::unique_lock lock(mutex_);
    for (;;) {
        wake_.wait(lock, [&] { return stop_ || generation_ != seen; });
        if (stop_) return;
        seen = generation_;
        const auto* job = job_;
        lock.unlock();
        std::exception_ptr failure;
        try {
            (*job)(worker);
        } catch (...) {
            failure = std::current_exception();
        }
        lock.lock();
        if (failure && !failure_) failure_ = failure;
        if (--running_ == 0) done_.notify_all();
    }
}

}  // namespace talbot
