#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "core/base/result.hpp"

// Only of pointers: OpenSSL's headers belong in .cpp files.
struct bio_st;
struct ssl_ctx_st;
struct x509_st;
struct evp_pkey_st;

namespace anchord::server {

template <class T, void (*Free)(T*)>
struct FreeBy {
  void operator()(T* held) const { Free(held); }
};
void free_bio(bio_st* bio);
void free_certificate(x509_st* certificate);
void free_key(evp_pkey_st* key);
using Bio = std::unique_ptr<bio_st, FreeBy<bio_st, free_bio>>;
using Certificate = std::unique_ptr<x509_st, FreeBy<x509_st, free_certificate>>;
using PrivateKey = std::unique_ptr<evp_pkey_st, FreeBy<evp_pkey_st, free_key>>;

/// Takes the oldest error of this thread out of OpenSSL's queue, and clears the rest: "no start line".
std::string take_openssl_error();

/// errors: invalid_argument, naming `called`
Result<Certificate> certificate_from_pem(std::string_view pem, const std::string& called);
Result<PrivateKey> key_from_pem(std::string_view pem, const std::string& called);

}  // namespace anchord::server
