/// The worker pool: our own threads, joined by the destructor (a joinable thread left at exit aborts the host program).
/// Flush-to-zero is set on every worker, as Embree recommends.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace talbot {

class WorkerPool {
public:
    explicit WorkerPool(int threads);  ///< 0: as many as the machine has
    ~WorkerPool();
    WorkerPool(const WorkerPool&) = delete;
    WorkerPool& operator=(const WorkerPool&) = delete;

    int size() const { return int(threads_.size()); }
    /// Runs job(worker) once on every worker and waits. The first exception a worker throws is thrown here.
    void run(const std::function<void(int worker)>& job);
    /// Splits [0, n) into chunks of `grain`, runs job(begin, end, worker) on the workers, waits. Dynamic order.
    void parallel_for(size_t n, size_t grain, const std::function<void(size_t begin, size_t end, int worker)>& job);

private:
    void worker_main(int worker);
    std::mutex run_mutex_;  ///< one run at a time
    std::mutex mutex_;
    std::condition_variable wake_, done_;
    const std::function<void(int)>* job_ = nullptr;
    uint64_t generation_ = 0;
    int running_ = 0;
    bool stop_ = false;
    std::exception_ptr failure_;
    std::vector<std::thread> threads_;
};

/// Denormals are flushed on the calling thread while this lives.
class FlushDenormals {
public:
    FlushDenormals();
    ~FlushDenormals();

private:
    unsigned saved_ = 0;
};

}  // namespace talbot
