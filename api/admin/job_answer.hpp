#pragma once

#include <functional>

#include "api/admin/job_service.hpp"
#include "api/kit/message.hpp"

namespace anchord::api {

/// 202 with the job, Location and Retry-After (or another status).
Response job_answer(int status, const Job& job);

/// The answer to a request that began a job. With `Prefer: wait=n` it waits that long, and answers with
/// `finished` where the job succeeded, or with the job's own problem where it failed: who waits wants to know
/// why, not that there was a job. Else 202.
Response job_outcome(JobService& jobs, const Request& request, Job job,
                     const std::function<Response(const Job&)>& finished);

}  // namespace anchord::api
