#include "api/kit/memory.hpp"

#include <malloc.h>

namespace anchord::api {

void give_back_memory() { ::malloc_trim(0); }

}  // namespace anchord::api
